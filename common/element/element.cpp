#include "common/element/element.hpp"
