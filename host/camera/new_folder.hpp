// A folder that appears with all its files, or not at all.
#pragma once

#include <filesystem>

namespace trocar::camera {

class NewFolder {
 public:
  // Throws config::UserError when it is there already or cannot be made.
  explicit NewFolder(std::filesystem::path folder);
  ~NewFolder();  // what was not kept is removed
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& part() const { return part_; }  // where to write meanwhile
  void keep();

 private:
  std::filesystem::path folder_{}, part_{};
};

}  // namespace trocar::camera
