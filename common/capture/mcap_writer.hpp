// Writes an MCAP file that survives its writer: messages are gathered in chunks of a quarter of a second, and each chunk goes to the
// operating system with one write, so that after a crash the file is readable up to the last whole chunk. close() adds the index.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "common/capture/mcap_format.hpp"

namespace trocar::capture {

struct CaptureError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct McapOptions {
  std::string profile;
  std::string library = "trocar";
  std::uint64_t chunk_ns = 250'000'000;            // a chunk is closed when its messages span this much log time
  std::size_t chunk_bytes = std::size_t{1} << 20;  // or when it holds this much
};

class McapWriter {
 public:
  // Refuses a file that exists. Errors name the path and what to do.
  explicit McapWriter(std::filesystem::path path, McapOptions options = {});
  ~McapWriter();  // closes as well as it can; call close() to learn of errors
  McapWriter(const McapWriter&) = delete;
  McapWriter& operator=(const McapWriter&) = delete;

  std::uint16_t add_schema(std::string_view name, std::string_view encoding, std::string_view data);
  std::uint16_t add_channel(std::uint16_t schema, std::string_view topic, std::string_view message_encoding,
                            std::map<std::string, std::string> metadata = {});
  void write(std::uint16_t channel, std::uint64_t log_time_ns, std::uint64_t publish_time_ns, std::span<const std::byte> data);
  void flush();  // writes the chunk at hand
  void close();

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  [[nodiscard]] std::uint64_t bytes() const noexcept { return position_; }  // in the file so far
  [[nodiscard]] std::uint64_t messages(std::uint16_t channel) const { return counts_.at(channel); }

 private:
  struct IndexEntry {
    std::uint64_t log_time_ns;
    std::uint64_t offset;
  };
  struct ChunkIndex {
    std::uint64_t start_ns, end_ns;
    std::uint64_t offset, length;
    std::map<std::uint16_t, std::uint64_t> index_offsets;
    std::uint64_t index_length;
    std::uint64_t records_size;
  };

  void put(const std::vector<std::byte>& bytes);  // appends to the file and to the data section's checksum
  [[noreturn]] void fail(const std::string& what, int error);

  std::filesystem::path path_;
  McapOptions options_;
  int fd_ = -1;
  std::uint64_t position_{};
  std::uint32_t data_crc_{};
  std::vector<Schema> schemas_;
  std::vector<Channel> channels_;
  std::map<std::uint16_t, std::uint64_t> counts_;
  std::vector<std::byte> chunk_;  // records of the chunk at hand
  std::map<std::uint16_t, std::vector<IndexEntry>> chunk_index_;
  std::uint64_t chunk_start_ns_{}, chunk_end_ns_{};
  std::vector<ChunkIndex> chunks_;
};

}  // namespace trocar::capture
