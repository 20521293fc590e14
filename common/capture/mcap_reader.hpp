// Reads an MCAP file whether it was closed or cut off, and says exactly what could not be read. Chunks must be uncompressed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "common/capture/mcap_format.hpp"

namespace trocar::capture {

struct Message {
  const Channel* channel{};
  std::uint32_t sequence{};
  std::uint64_t log_time_ns{};
  std::uint64_t publish_time_ns{};
  std::span<const std::byte> data;  // valid during the visit only
};

struct ReadReport {
  bool finished{};  // closed by its writer, and the index at its end is whole
  std::uint64_t messages{};
  std::uint64_t chunks{};             // read and found intact
  std::uint64_t damaged_chunks{};     // left out because their checksum or layout is wrong
  std::uint64_t lost_messages{};      // known only when the file is finished
  std::uint64_t lost_bytes{};         // at the end of a file that was cut off, or skipped to find the next whole chunk
  std::vector<std::string> problems;  // one sentence each, empty when every byte is as it was written
};

struct Selection {
  std::set<std::string> topics;  // empty: all
  std::uint64_t from_ns = 0;     // log time, both ends included
  std::uint64_t to_ns = std::numeric_limits<std::uint64_t>::max();
};

class McapReader {
 public:
  // Throws CaptureError when the file cannot be opened or is not MCAP at all.
  explicit McapReader(const std::filesystem::path& path);

  using Visit = std::function<void(const Message&)>;
  // Every message in the order of the file, with every checksum verified.
  ReadReport read(const Visit& visit);
  // The same for a part; with an index only the chunks that matter are touched (and verified).
  ReadReport read(const Visit& visit, const Selection& selection);

  // Known after construction when the file is finished, otherwise as far as read() has come.
  [[nodiscard]] const std::map<std::uint16_t, Schema>& schemas() const noexcept { return schemas_; }
  [[nodiscard]] const std::map<std::uint16_t, Channel>& channels() const noexcept { return channels_; }
  [[nodiscard]] bool finished() const noexcept { return index_.has_value(); }
  [[nodiscard]] const std::string& library() const noexcept { return library_; }

 private:
  struct File {
    int fd = -1;
    File() = default;
    ~File();
    File(const File&) = delete;
    File& operator=(const File&) = delete;
  };
  struct ChunkEntry {
    std::uint64_t start_ns, end_ns, offset, length;
    std::set<std::uint16_t> channels;
  };
  struct Index {
    std::uint64_t data_end;  // offset of the DataEnd record
    std::uint64_t messages;
    std::vector<ChunkEntry> chunks;  // by offset
  };
  struct Pass;  // one reading in progress

  [[nodiscard]] std::vector<std::byte> read_at(std::uint64_t offset, std::uint64_t size) const;
  std::string load_index();  // what is wrong with it, or nothing
  void read_data_section(Pass& pass);
  bool read_record(Pass& pass, Opcode opcode, std::span<const std::byte> content);
  bool read_chunk(Pass& pass, std::uint64_t offset, std::span<const std::byte> content);
  void read_message(Pass& pass, std::span<const std::byte> content);
  [[nodiscard]] std::optional<std::uint64_t> next_chunk(std::uint64_t offset, std::uint64_t end) const;
  void check_data_section(Pass& pass) const;

  std::filesystem::path path_;
  File file_;
  std::uint64_t size_{};
  std::string library_;
  std::map<std::uint16_t, Schema> schemas_;
  std::map<std::uint16_t, Channel> channels_;
  std::optional<Index> index_;
  std::string index_problem_;
};

}  // namespace trocar::capture
