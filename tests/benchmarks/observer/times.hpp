// What an estimate costs a tick.
#pragma once

#include "tests/benchmarks/observer/course.hpp"

namespace trocar::bench {

// All methods taking turns over the samples of a course; medians and quartiles on the terminal.
void print_times(const Course& course, const rig::Rig& rig, int turns);

}  // namespace trocar::bench
