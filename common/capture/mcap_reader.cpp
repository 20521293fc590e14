#include "common/capture/mcap_reader.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "common/capture/bytes.hpp"
#include "common/capture/mcap_writer.hpp"
#include "common/core/checksum.hpp"

namespace trocar::capture {

namespace {

struct RecordHead {
  Opcode opcode;
  std::uint64_t length;
};

RecordHead head_of(std::span<const std::byte> bytes) {
  ByteReader in(bytes);
  const auto opcode = static_cast<Opcode>(in.number<std::uint8_t>());
  return {opcode, in.number<std::uint64_t>()};
}

bool is_magic(std::span<const std::byte> bytes) { return std::ranges::equal(bytes, std::as_bytes(std::span(mcap::magic))); }

Schema parse_schema(ByteReader& in) {
  Schema schema;
  schema.id = in.number<std::uint16_t>();
  schema.name = in.text();
  schema.encoding = in.text();
  schema.data = in.text();
  return schema;
}

Channel parse_channel(ByteReader& in) {
  Channel channel;
  channel.id = in.number<std::uint16_t>();
  channel.schema_id = in.number<std::uint16_t>();
  channel.topic = in.text();
  channel.message_encoding = in.text();
  ByteReader metadata(in.raw(in.number<std::uint32_t>()));
  while (metadata.ok() && metadata.left() > 0) {
    std::string key = metadata.text();
    channel.metadata[std::move(key)] = metadata.text();
  }
  return channel;
}

struct ChunkContent {
  std::uint64_t start_ns{}, end_ns{};
  std::uint64_t records_size{};
  std::uint32_t crc{};
  std::string compression;
  std::span<const std::byte> records;
  bool whole{};
};

ChunkContent parse_chunk(std::span<const std::byte> content) {
  ByteReader in(content);
  ChunkContent chunk;
  chunk.start_ns = in.number<std::uint64_t>();
  chunk.end_ns = in.number<std::uint64_t>();
  chunk.records_size = in.number<std::uint64_t>();
  chunk.crc = in.number<std::uint32_t>();
  chunk.compression = in.text();
  chunk.records = in.raw(in.number<std::uint64_t>());
  chunk.whole = in.ok() && in.left() == 0;
  return chunk;
}

std::string seconds(std::uint64_t ns) {
  const std::string fraction = std::to_string(ns % 1'000'000'000 / 1'000'000);
  return std::to_string(ns / 1'000'000'000) + "." + std::string(3 - fraction.size(), '0') + fraction + " s";
}

}  // namespace

struct McapReader::Pass {
  const Visit& visit;
  const Selection& selection;
  ReadReport report;
  std::uint64_t end;  // the data section ends before this byte
  bool data_ended{};
};

McapReader::McapReader(const std::filesystem::path& path) : path_(path) {
  file_.fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat status {};
  if (file_.fd < 0 || ::fstat(file_.fd, &status) != 0) throw CaptureError("cannot read " + path.string() + ": " + std::strerror(errno));
  if (!S_ISREG(status.st_mode)) throw CaptureError("cannot read " + path.string() + ": it is not a regular file");
  size_ = static_cast<std::uint64_t>(status.st_size);
  const auto start = read_at(0, std::min<std::uint64_t>(size_, mcap::magic.size()));
  if (!std::ranges::equal(start, std::as_bytes(std::span(mcap::magic)).first(start.size()))) {
    throw CaptureError(path.string() + " is not an MCAP file: it does not begin with the mark of that format");
  }
  index_problem_ = load_index();
  if (!index_problem_.empty()) {
    index_.reset();
    schemas_.clear();
    channels_.clear();
  }
}

McapReader::File::~File() {
  if (fd >= 0) ::close(fd);
}

std::vector<std::byte> McapReader::read_at(std::uint64_t offset, std::uint64_t size) const {
  std::vector<std::byte> bytes(offset > size_ ? 0 : static_cast<std::size_t>(std::min(size, size_ - offset)));
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count = ::pread(file_.fd, bytes.data() + done, bytes.size() - done, static_cast<off_t>(offset + done));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw CaptureError("cannot read " + path_.string() + ": " + std::strerror(errno));
    if (count == 0) break;  // shortened meanwhile
    done += static_cast<std::size_t>(count);
  }
  bytes.resize(done);
  return bytes;
}

std::string McapReader::load_index() {
  const std::uint64_t tail = mcap::footer_record + mcap::magic.size();
  if (size_ < mcap::magic.size() + tail || !is_magic(read_at(size_ - mcap::magic.size(), mcap::magic.size()))) {
    return "the recording was not closed (its writer was ended, or the end of the file is lost)";
  }
  const std::uint64_t footer_at = size_ - tail;
  const auto footer = read_at(footer_at, mcap::footer_record);
  const RecordHead head = head_of(footer);
  ByteReader in{std::span(footer).subspan(mcap::record_head)};
  const auto summary_at = in.number<std::uint64_t>();
  in.number<std::uint64_t>();
  const auto summary_crc = in.number<std::uint32_t>();
  const std::uint64_t first = mcap::magic.size() + mcap::data_end_record;
  if (head.opcode != Opcode::Footer || head.length != mcap::footer_record - mcap::record_head || summary_at < first ||
      summary_at > footer_at) {
    return "the footer is damaged or names no index";
  }
  const auto data_end = read_at(summary_at - mcap::data_end_record, mcap::data_end_record);
  if (head_of(data_end).opcode != Opcode::DataEnd || head_of(data_end).length != mcap::data_end_record - mcap::record_head) {
    return "the index does not follow an end of the data section";
  }
  const auto summary = read_at(summary_at, footer_at - summary_at + mcap::footer_record - 4);
  if (summary_crc != 0 && crc32(summary) != summary_crc) return "the index is damaged: its checksum does not match";

  Index index{summary_at - mcap::data_end_record, 0, {}};
  ByteReader records{std::span(summary).first(static_cast<std::size_t>(footer_at - summary_at))};
  while (records.left() > 0) {
    const auto opcode = static_cast<Opcode>(records.number<std::uint8_t>());
    ByteReader record(records.raw(records.number<std::uint64_t>()));
    if (opcode == Opcode::Schema) {
      const Schema schema = parse_schema(record);
      schemas_[schema.id] = schema;
    } else if (opcode == Opcode::Channel) {
      const Channel channel = parse_channel(record);
      channels_[channel.id] = channel;
    } else if (opcode == Opcode::Statistics) {
      index.messages = record.number<std::uint64_t>();
    } else if (opcode == Opcode::ChunkIndex) {
      ChunkEntry chunk;
      chunk.start_ns = record.number<std::uint64_t>();
      chunk.end_ns = record.number<std::uint64_t>();
      chunk.offset = record.number<std::uint64_t>();
      chunk.length = record.number<std::uint64_t>();
      ByteReader offsets(record.raw(record.number<std::uint32_t>()));
      while (offsets.ok() && offsets.left() > 0) {
        chunk.channels.insert(offsets.number<std::uint16_t>());
        offsets.number<std::uint64_t>();
      }
      if (chunk.length < mcap::record_head || chunk.offset > index.data_end || chunk.length > index.data_end - chunk.offset) {
        return "the index names a chunk outside of the file";
      }
      index.chunks.push_back(std::move(chunk));
    }
    if (!records.ok() || !record.ok()) return "the index is damaged: a record in it is cut short";
  }
  std::ranges::sort(index.chunks, {}, &ChunkEntry::offset);
  index_ = std::move(index);
  return {};
}

ReadReport McapReader::read(const Visit& visit) { return read(visit, {}); }

ReadReport McapReader::read(const Visit& visit, const Selection& selection) {
  Pass pass{visit, selection, {}, index_ ? index_->data_end : size_, false};
  pass.report.finished = index_.has_value();
  if (!index_) pass.report.problems.push_back(index_problem_);

  const bool everything =
      selection.topics.empty() && selection.from_ns == 0 && selection.to_ns == std::numeric_limits<std::uint64_t>::max();
  if (index_ && !everything) {
    for (const ChunkEntry& chunk : index_->chunks) {
      if (chunk.end_ns < selection.from_ns || chunk.start_ns > selection.to_ns) continue;
      const auto wanted = [&](std::uint16_t id) {
        return selection.topics.empty() || (channels_.contains(id) && selection.topics.contains(channels_.at(id).topic));
      };
      if (!chunk.channels.empty() && std::ranges::none_of(chunk.channels, wanted)) continue;
      const auto bytes = read_at(chunk.offset, chunk.length);
      const RecordHead head = head_of(bytes);
      if (head.opcode != Opcode::Chunk || head.length != chunk.length - mcap::record_head || bytes.size() != chunk.length) {
        ++pass.report.damaged_chunks;
        pass.report.problems.push_back("there is no whole chunk at byte " + std::to_string(chunk.offset) + ", where the index names one");
        continue;
      }
      read_chunk(pass, chunk.offset, std::span(bytes).subspan(mcap::record_head));
    }
    return std::move(pass.report);
  }

  read_data_section(pass);
  if (index_ && pass.report.messages < index_->messages) {
    pass.report.lost_messages = index_->messages - pass.report.messages;
    pass.report.problems.push_back(std::to_string(pass.report.lost_messages) + " of " + std::to_string(index_->messages) +
                                   " messages are lost");
  }
  return std::move(pass.report);
}

void McapReader::read_data_section(Pass& pass) {
  ReadReport& report = pass.report;
  std::uint64_t offset = std::min<std::uint64_t>(size_, mcap::magic.size());
  std::uint64_t behind_chunk = offset;
  while (offset < pass.end && !pass.data_ended) {
    const std::uint64_t left = pass.end - offset;
    const auto bytes = read_at(offset, std::min<std::uint64_t>(left, mcap::record_head));
    const RecordHead head = head_of(bytes);
    bool good = left >= mcap::record_head && head.length <= left - mcap::record_head;
    // An unknown record is skipped, as the format asks; but not over the start of a chunk that the index knows.
    if (good && index_) {
      const auto next = next_chunk(offset + 1, pass.end);
      good = !next || offset + mcap::record_head + head.length <= *next;
    }
    if (good) {
      const auto content = read_at(offset + mcap::record_head, head.length);
      good = head.opcode == Opcode::Chunk ? read_chunk(pass, offset, content) : read_record(pass, head.opcode, content);
    }
    if (good) {
      offset += mcap::record_head + head.length;
      if (head.opcode == Opcode::Chunk) behind_chunk = offset;
      continue;
    }
    // Without an index a wrong length may have led across the start of a chunk: search from behind the last one.
    const auto next = next_chunk(index_ ? offset + 1 : behind_chunk, pass.end);
    const std::uint64_t from = next && *next < offset ? behind_chunk : offset;
    const std::uint64_t until = next.value_or(pass.end);
    report.lost_bytes += until - from;
    report.problems.push_back(next ? "bytes " + std::to_string(from) + " to " + std::to_string(until) + " are damaged and were skipped"
                                   : "cut off or damaged at byte " + std::to_string(from) + " of " + std::to_string(size_) + ": the last " +
                                         std::to_string(until - from) + " bytes hold no whole record and are lost");
    offset = until;
  }
  if (index_) check_data_section(pass);
}

// False when the record makes no sense, so that its length is not to be trusted either.
bool McapReader::read_record(Pass& pass, Opcode opcode, std::span<const std::byte> content) {
  ByteReader in(content);
  switch (opcode) {
    case Opcode::Header:
      in.text();
      library_ = in.text();
      break;
    case Opcode::Schema: {
      const Schema schema = parse_schema(in);
      if (in.ok()) schemas_.try_emplace(schema.id, schema);
      break;
    }
    case Opcode::Channel: {
      const Channel channel = parse_channel(in);
      if (in.ok()) channels_.try_emplace(channel.id, channel);
      break;
    }
    case Opcode::Message:
      read_message(pass, content);
      break;
    case Opcode::DataEnd:
      in.number<std::uint32_t>();
      pass.data_ended = in.ok();
      break;
    default:
      break;
  }
  return in.ok();
}

// Nothing is handed out of a chunk before its checksum was verified. True when its bounds are sound, so that reading can go on behind it.
bool McapReader::read_chunk(Pass& pass, std::uint64_t offset, std::span<const std::byte> content) {
  ReadReport& report = pass.report;
  const ChunkContent chunk = parse_chunk(content);
  const auto name = [&] { return "the chunk at byte " + std::to_string(offset); };
  if (!chunk.whole) {
    ++report.damaged_chunks;
    if (pass.report.finished) report.problems.push_back(name() + " is damaged: its lengths contradict each other");
    return false;
  }
  const std::string when = " (" + seconds(chunk.start_ns) + " to " + seconds(chunk.end_ns) + ")";
  if (!chunk.compression.empty()) {
    ++report.damaged_chunks;
    report.problems.push_back(name() + when + " is compressed with " + printable(chunk.compression) + ", which this reader does not know");
    return true;
  }
  const std::uint32_t crc = crc32(chunk.records);
  if ((chunk.crc != 0 && crc != chunk.crc) || chunk.records_size != chunk.records.size()) {
    ++report.damaged_chunks;
    report.problems.push_back(name() + when + " is damaged: its checksum does not match; its messages are left out");
    return true;
  }
  ++report.chunks;
  ByteReader records(chunk.records);
  while (records.left() > 0) {
    const auto opcode = static_cast<Opcode>(records.number<std::uint8_t>());
    const auto record = records.raw(records.number<std::uint64_t>());
    if (!records.ok() || !read_record(pass, opcode, record)) {
      report.problems.push_back(name() + when + " holds a malformed record; the rest of it is left out");
      break;
    }
  }
  return true;
}

void McapReader::read_message(Pass& pass, std::span<const std::byte> content) {
  ByteReader in(content);
  const auto channel = in.number<std::uint16_t>();
  Message message;
  message.sequence = in.number<std::uint32_t>();
  message.log_time_ns = in.number<std::uint64_t>();
  message.publish_time_ns = in.number<std::uint64_t>();
  message.data = in.raw(in.left());
  const auto found = channels_.find(channel);
  if (!in.ok() || found == channels_.end()) {
    pass.report.problems.push_back("a message of the undeclared channel " + std::to_string(channel) + " is left out");
    return;
  }
  message.channel = &found->second;
  const Selection& selection = pass.selection;
  if (message.log_time_ns < selection.from_ns || message.log_time_ns > selection.to_ns) return;
  if (!selection.topics.empty() && !selection.topics.contains(found->second.topic)) return;
  ++pass.report.messages;
  pass.visit(message);
}

// Where the next chunk begins at or behind `offset`: from the index, or, without one, by looking for a record that has the layout and
// the checksum of a chunk.
std::optional<std::uint64_t> McapReader::next_chunk(std::uint64_t offset, std::uint64_t end) const {
  if (index_) {
    const auto found = std::ranges::lower_bound(index_->chunks, offset, {}, &ChunkEntry::offset);
    return found == index_->chunks.end() ? std::nullopt : std::optional(found->offset);
  }
  constexpr std::uint64_t piece = 1 << 20;
  for (std::uint64_t base = offset; base < end; base += piece) {
    const auto bytes = read_at(base, std::min(piece + mcap::record_head, end - base));
    for (std::size_t i = 0; i < std::min<std::size_t>(bytes.size(), piece); ++i) {
      if (bytes[i] != static_cast<std::byte>(Opcode::Chunk) || bytes.size() - i < mcap::record_head) continue;
      const RecordHead head = head_of(std::span(bytes).subspan(i));
      const std::uint64_t at = base + i;
      if (head.length > end - at - mcap::record_head) continue;
      const auto content = read_at(at + mcap::record_head, std::min<std::uint64_t>(head.length, 64));
      ByteReader in(content);  // start, end, size, checksum, compression "", size again: only then is it worth reading whole
      in.raw(16);
      const auto records_size = in.number<std::uint64_t>();
      in.number<std::uint32_t>();
      if (in.number<std::uint32_t>() != 0 || in.number<std::uint64_t>() != records_size || !in.ok()) continue;
      const auto whole = read_at(at + mcap::record_head, head.length);
      const ChunkContent chunk = parse_chunk(whole);
      if (chunk.whole && crc32(chunk.records) == chunk.crc) return at;
    }
  }
  return std::nullopt;
}

// The data section's own checksum covers what no chunk's does: headers, schemas, channels and message indexes.
void McapReader::check_data_section(Pass& pass) const {
  std::uint32_t crc = 0;
  const std::uint64_t end = index_->data_end;
  constexpr std::uint64_t piece = 1 << 20;
  for (std::uint64_t at = 0; at < end; at += piece) crc = crc32(read_at(at, std::min(piece, end - at)), crc);
  const auto record = read_at(end, mcap::data_end_record);
  ByteReader in{std::span(record).subspan(mcap::record_head)};
  const auto expected = in.number<std::uint32_t>();
  if (expected != 0 && crc != expected && pass.report.problems.empty()) {
    pass.report.problems.push_back(
        "bytes outside of the chunks have changed: the checksum of the data section does not match; all messages are intact");
  }
}

}  // namespace trocar::capture
