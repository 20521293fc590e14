// A file that appears whole or not at all: written beside its place, and renamed into it by commit().
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>

namespace trocar::image_file {

class PendingFile {
 public:
  // Creates the temporary, so that a place that cannot be written is noticed before the work. Throws config::UserError, as all below.
  explicit PendingFile(std::filesystem::path file);
  ~PendingFile();  // without commit() nothing remains
  PendingFile(const PendingFile&) = delete;
  PendingFile& operator=(const PendingFile&) = delete;

  void write(std::span<const std::byte> bytes);
  void sync();    // to the disk: what can still fail, fails here
  void commit();  // sync() has to precede

 private:
  [[noreturn]] void fail(int error) const;
  std::filesystem::path file_;
  std::filesystem::path temporary_;
  int descriptor_{-1};
};

}  // namespace trocar::image_file
