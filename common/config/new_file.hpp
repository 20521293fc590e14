// A file that appears whole or not at all: it is written beside its place under another name, and renamed when it is complete.
#pragma once

#include <filesystem>
#include <fstream>

namespace trocar::config {

class NewFile {
 public:
  // Throws UserError when `file` is a folder or a device, or its folder does not exist or cannot be written to.
  explicit NewFile(std::filesystem::path file);
  ~NewFile();  // what was not kept is removed
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  [[nodiscard]] std::ostream& stream() { return stream_; }
  // Puts the file in its place, instead of one that was there. Throws UserError when not everything could be written.
  void keep();

 private:
  std::filesystem::path file_;
  std::filesystem::path part_;
  std::ofstream stream_;
};

}  // namespace trocar::config
