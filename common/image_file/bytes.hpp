// Read-only files in memory, and memory that is aligned as model::open asks for.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <new>
#include <span>

#include "common/model/image.hpp"

namespace trocar::image_file {

// Uninitialised; begins on model::image_alignment.
class AlignedBytes {
 public:
  AlignedBytes() = default;
  explicit AlignedBytes(std::size_t size)
      : data_(static_cast<std::byte*>(::operator new[](size, std::align_val_t{model::image_alignment}))), size_(size) {}
  [[nodiscard]] std::span<std::byte> span() { return {data_.get(), size_}; }
  [[nodiscard]] std::span<const std::byte> span() const { return {data_.get(), size_}; }

 private:
  struct Delete {
    void operator()(std::byte* data) const { ::operator delete[](data, std::align_val_t{model::image_alignment}); }
  };
  std::unique_ptr<std::byte[], Delete> data_{};
  std::size_t size_{};
};

enum class Lock { No, Yes };

// A whole file for reading. Lock::No maps it: writers replace files by renaming, so a mapped one does not change. Lock::Yes makes a copy
// that stays in memory, so that no read of it waits for a disk and whatever happens to the file is no matter. Throws config::UserError
// naming the file and the reason.
class MappedFile {
 public:
  MappedFile(const std::filesystem::path& file, Lock lock);
  MappedFile(MappedFile&& other) noexcept : data_(other.data_), size_(other.size_) { other.data_ = nullptr; }
  MappedFile& operator=(MappedFile&& other) noexcept;
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;
  ~MappedFile();
  [[nodiscard]] std::span<const std::byte> bytes() const { return {static_cast<const std::byte*>(data_), size_}; }

 private:
  void* data_{};
  std::size_t size_{};
};

}  // namespace trocar::image_file
