// What common/fem refuses, as a message for a person that begins with the scene's file.
#pragma once

#include "common/config/user_error.hpp"
#include "common/fem/tissue.hpp"
#include "common/scene/scene.hpp"

namespace trocar::condense {

template <typename Work>
auto naming_the_file(const scene::Scene& scene, const Work& work) {
  try {
    return work();
  } catch (const fem::Error& error) {
    throw config::UserError(scene.file.empty() ? std::string(error.what()) : scene.file.string() + ": " + error.what());
  }
}

}  // namespace trocar::condense
