#include "common/capture/mcap_writer.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "common/capture/bytes.hpp"
#include "common/core/checksum.hpp"

namespace trocar::capture {

namespace {

void append_schema(std::vector<std::byte>& out, const Schema& schema) {
  RecordBuilder record(out);
  record.begin(Opcode::Schema).number(schema.id).text(schema.name).text(schema.encoding).text(schema.data).end();
}

void append_channel(std::vector<std::byte>& out, const Channel& channel) {
  RecordBuilder record(out);
  record.begin(Opcode::Channel).number(channel.id).number(channel.schema_id).text(channel.topic).text(channel.message_encoding);
  std::size_t bytes = 0;
  for (const auto& [key, value] : channel.metadata) bytes += 8 + key.size() + value.size();
  record.number(static_cast<std::uint32_t>(bytes));
  for (const auto& [key, value] : channel.metadata) record.text(key).text(value);
  record.end();
}

const char* remedy(int error) {
  switch (error) {
    case ENOSPC:
    case EDQUOT:
      return "; free some space or choose another folder";
    case EACCES:
    case EPERM:
    case EROFS:
      return "; choose a folder that you may write to";
    case ENOENT:
    case ENOTDIR:
      return "; create the folder first";
    case EEXIST:
      return "; a capture is never overwritten: choose another name or move the old file away";
    default:
      return "";
  }
}

}  // namespace

McapWriter::McapWriter(std::filesystem::path path, McapOptions options) : path_(std::move(path)), options_(std::move(options)) {
  fd_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  const bool created = fd_ >= 0;
  // A device may exist already (a test of a full disk); only a regular file is somebody's recording.
  if (fd_ < 0 && errno == EEXIST && !std::filesystem::is_regular_file(path_)) fd_ = ::open(path_.c_str(), O_WRONLY | O_CLOEXEC);
  if (fd_ < 0) {
    const int error = errno;
    throw CaptureError("cannot create " + path_.string() + ": " + std::strerror(error) + remedy(error));
  }
  std::vector<std::byte> out;
  RecordBuilder record(out);
  record.raw(std::as_bytes(std::span(mcap::magic)));
  record.begin(Opcode::Header).text(options_.profile).text(options_.library).end();
  try {
    put(out);
  } catch (...) {
    if (created) ::unlink(path_.c_str());
    throw;
  }
}

McapWriter::~McapWriter() {
  try {
    close();
  } catch (const CaptureError&) {  // NOLINT(bugprone-empty-catch): whoever wanted to know called close()
  }
}

std::uint16_t McapWriter::add_schema(std::string_view name, std::string_view encoding, std::string_view data) {
  schemas_.push_back({static_cast<std::uint16_t>(schemas_.size() + 1), std::string(name), std::string(encoding), std::string(data)});
  std::vector<std::byte> out;
  append_schema(out, schemas_.back());
  put(out);
  return schemas_.back().id;
}

std::uint16_t McapWriter::add_channel(std::uint16_t schema, std::string_view topic, std::string_view message_encoding,
                                      std::map<std::string, std::string> metadata) {
  channels_.push_back(
      {static_cast<std::uint16_t>(channels_.size()), schema, std::string(topic), std::string(message_encoding), std::move(metadata)});
  counts_[channels_.back().id] = 0;
  std::vector<std::byte> out;
  append_channel(out, channels_.back());
  put(out);
  return channels_.back().id;
}

void McapWriter::write(std::uint16_t channel, std::uint64_t log_time_ns, std::uint64_t publish_time_ns, std::span<const std::byte> data) {
  const bool spans_enough = !chunk_.empty() && log_time_ns >= chunk_start_ns_ && log_time_ns - chunk_start_ns_ >= options_.chunk_ns;
  if (spans_enough || chunk_.size() >= options_.chunk_bytes) flush();
  if (chunk_.empty()) chunk_start_ns_ = chunk_end_ns_ = log_time_ns;
  chunk_start_ns_ = std::min(chunk_start_ns_, log_time_ns);
  chunk_end_ns_ = std::max(chunk_end_ns_, log_time_ns);
  chunk_index_[channel].push_back({log_time_ns, chunk_.size()});
  const auto sequence = static_cast<std::uint32_t>(counts_.at(channel)++);
  RecordBuilder record(chunk_);
  record.begin(Opcode::Message).number(channel).number(sequence).number(log_time_ns).number(publish_time_ns).raw(data).end();
}

void McapWriter::flush() {
  if (chunk_.empty()) return;
  ChunkIndex index{chunk_start_ns_, chunk_end_ns_, position_, 0, {}, 0, chunk_.size()};
  std::vector<std::byte> out;
  RecordBuilder record(out);
  record.begin(Opcode::Chunk).number(chunk_start_ns_).number(chunk_end_ns_).number(std::uint64_t{chunk_.size()});
  record.number(crc32(chunk_)).text("").number(std::uint64_t{chunk_.size()}).raw(chunk_).end();
  index.length = out.size();
  for (const auto& [channel, entries] : chunk_index_) {
    index.index_offsets[channel] = position_ + out.size();
    record.begin(Opcode::MessageIndex).number(channel).number(static_cast<std::uint32_t>(16 * entries.size()));
    for (const IndexEntry& entry : entries) record.number(entry.log_time_ns).number(entry.offset);
    record.end();
  }
  index.index_length = out.size() - index.length;
  chunk_.clear();
  chunk_index_.clear();
  put(out);
  chunks_.push_back(std::move(index));
}

void McapWriter::close() {
  if (fd_ < 0) return;
  flush();

  std::vector<std::byte> out;
  RecordBuilder record(out);
  record.begin(Opcode::DataEnd).number(data_crc_).end();
  const std::size_t summary_at = out.size();
  const std::uint64_t summary_start = position_ + summary_at;

  struct Group {
    Opcode opcode;
    std::uint64_t start, length;
  };
  std::vector<Group> groups;
  const auto group = [&](Opcode opcode, auto&& fill) {
    const std::size_t begin = out.size();
    fill();
    if (out.size() > begin) groups.push_back({opcode, position_ + begin, out.size() - begin});
  };
  group(Opcode::Schema, [&] {
    for (const Schema& schema : schemas_) append_schema(out, schema);
  });
  group(Opcode::Channel, [&] {
    for (const Channel& channel : channels_) append_channel(out, channel);
  });
  group(Opcode::Statistics, [&] {
    std::uint64_t total = 0, start = 0, end = 0;
    for (const auto& [channel, count] : counts_) total += count;
    if (!chunks_.empty()) start = chunks_.front().start_ns;
    for (const ChunkIndex& chunk : chunks_) {
      start = std::min(start, chunk.start_ns);
      end = std::max(end, chunk.end_ns);
    }
    record.begin(Opcode::Statistics).number(total).number(static_cast<std::uint16_t>(schemas_.size()));
    record.number(static_cast<std::uint32_t>(channels_.size())).number(std::uint32_t{0}).number(std::uint32_t{0});
    record.number(static_cast<std::uint32_t>(chunks_.size())).number(start).number(end);
    record.number(static_cast<std::uint32_t>(10 * counts_.size()));
    for (const auto& [channel, count] : counts_) record.number(channel).number(count);
    record.end();
  });
  group(Opcode::ChunkIndex, [&] {
    for (const ChunkIndex& chunk : chunks_) {
      record.begin(Opcode::ChunkIndex).number(chunk.start_ns).number(chunk.end_ns).number(chunk.offset).number(chunk.length);
      record.number(static_cast<std::uint32_t>(10 * chunk.index_offsets.size()));
      for (const auto& [channel, offset] : chunk.index_offsets) record.number(channel).number(offset);
      record.number(chunk.index_length).text("").number(chunk.records_size).number(chunk.records_size).end();
    }
  });
  const std::uint64_t offsets_start = position_ + out.size();
  for (const Group& part : groups) {
    record.begin(Opcode::SummaryOffset).number(static_cast<std::uint8_t>(part.opcode)).number(part.start).number(part.length).end();
  }

  record.begin(Opcode::Footer).number(summary_start).number(offsets_start).number(std::uint32_t{0}).end();
  // The summary's checksum runs up to itself, record head of the footer included.
  const std::size_t crc_at = out.size() - 4;
  record.patch(crc_at, crc32(std::span(out).subspan(summary_at, crc_at - summary_at)));
  record.raw(std::as_bytes(std::span(mcap::magic)));
  put(out);

  const int fd = std::exchange(fd_, -1);
  if (::close(fd) != 0) fail("closing", errno);
}

void McapWriter::put(const std::vector<std::byte>& bytes) {
  if (fd_ < 0) throw CaptureError(path_.string() + " is closed");
  std::span<const std::byte> rest(bytes);
  while (!rest.empty()) {
    const ssize_t written = ::write(fd_, rest.data(), rest.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail("writing", errno);
    rest = rest.subspan(static_cast<std::size_t>(written));
  }
  data_crc_ = crc32(bytes, data_crc_);
  position_ += bytes.size();
}

void McapWriter::fail(const std::string& what, int error) {
  if (const int fd = std::exchange(fd_, -1); fd >= 0) {
    // Without the torn record the file ends at a whole chunk. If even that fails, the reader copes.
    [[maybe_unused]] const int ignored = ::ftruncate(fd, static_cast<off_t>(position_));
    ::close(fd);
  }
  throw CaptureError(what + " " + path_.string() + " failed: " + std::strerror(error) + remedy(error) +
                     (position_ > 0 ? " (everything before is readable)" : ""));
}

}  // namespace trocar::capture
