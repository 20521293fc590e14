#include "common/capture/cdr.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>

#include "dds/ddsi/ddsi_cdrstream.h"

namespace trocar::capture {

namespace {

constexpr std::uint32_t xcdr2 = 2;
constexpr std::byte d_cdr2_be{0x08};
constexpr std::byte d_cdr2_le{0x09};
constexpr std::size_t header_size = 4;
// Cyclone 0.10.2 counts a double of an array as four bytes when it checks whether the array fits, but reads eight: up to half of the last
// array lies beyond the message. Longer than half of any array in rig.idl.
constexpr std::size_t slack = 64;

// DDS pads a message to 4 bytes and says in the header's last byte by how much.
std::vector<std::byte> with_header(std::span<const std::byte> body) {
  const std::size_t padding = (4 - body.size() % 4) % 4;
  std::vector<std::byte> cdr(header_size + body.size() + padding);
  cdr[1] = d_cdr2_le;
  cdr[3] = static_cast<std::byte>(padding);
  std::ranges::copy(body, cdr.begin() + header_size);
  return cdr;
}

}  // namespace

namespace detail {

std::vector<std::byte> serialise(const void* value, const dds_topic_descriptor_t& type) {
  static_assert(std::endian::native == std::endian::little, "the header below says little endian");
  struct Stream {
    dds_ostream_t out{};
    Stream() { dds_ostream_init(&out, 0, xcdr2); }
    ~Stream() { dds_ostream_fini(&out); }
  } stream;
  if (dds_stream_write(&stream.out, static_cast<const char*>(value), type.m_ops) == nullptr) {
    throw CdrError(std::string("this ") + type.m_typename + " cannot be serialised: a sequence is longer than rig.idl allows");
  }
  return with_header(std::as_bytes(std::span(stream.out.m_buffer, stream.out.m_index)));
}

void deserialise(std::span<const std::byte> cdr, void* value, const dds_topic_descriptor_t& type) {
  const auto refuse = [&](const std::string& why) { throw CdrError(std::string("not a ") + type.m_typename + ": " + why); };
  if (cdr.size() < header_size || cdr.size() > std::numeric_limits<std::uint32_t>::max()) {
    refuse(std::to_string(cdr.size()) + " bytes are no CDR message");
  }
  if (cdr[0] != std::byte{0} || (cdr[1] != d_cdr2_le && cdr[1] != d_cdr2_be)) {
    refuse("representation " + std::to_string(256 * std::to_integer<int>(cdr[0]) + std::to_integer<int>(cdr[1])) +
           " where 9 (delimited XCDR2, little endian) is expected");
  }
  const std::size_t padding = std::to_integer<std::size_t>(cdr[3]) & 3u;
  if (cdr.size() <= header_size + padding) refuse("there is nothing but a header");

  // Checking swaps bytes in place where needed, and makes the reading below safe against hostile lengths.
  const auto size = static_cast<std::uint32_t>(cdr.size() - header_size - padding);
  std::vector<char> body(size + slack);
  std::ranges::copy(cdr.subspan(header_size, size), reinterpret_cast<std::byte*>(body.data()));
  std::uint32_t offset = 0;
  if (dds_stream_normalize_data(body.data(), &offset, size, cdr[1] == d_cdr2_be, xcdr2, type.m_ops) == nullptr) {
    refuse("the bytes do not fit the type");
  }
  dds_istream_t in{};
  dds_istream_init(&in, size, body.data(), xcdr2);
  dds_stream_read(&in, static_cast<char*>(value), type.m_ops);
  const bool beyond = in.m_index > size;
  dds_istream_fini(&in);
  if (beyond) {
    release(value, type);
    refuse("the bytes end within an array");
  }
}

void release(void* value, const dds_topic_descriptor_t& type) noexcept { dds_stream_free_sample(value, type.m_ops); }

}  // namespace detail

template <class Batch>
std::vector<std::vector<std::byte>> split_batch(std::span<const std::byte> cdr) {
  const Decoded<Batch> batch(cdr);  // from here on all lengths are known to fit
  const std::uint32_t count = batch->samples._length;
  std::vector<std::vector<std::byte>> samples;
  samples.reserve(count);
  if (cdr[1] == d_cdr2_be) {
    for (const wire::Sample& sample : std::span(batch->samples._buffer, count)) samples.push_back(serialise(sample));
    return samples;
  }
  const auto body = cdr.subspan(header_size);
  // Delimiter, protocol, dropped (or end_ns), delimiter of the sequence, its length; then per sample a delimiter and its bytes. Nothing is
  // aligned to more than 4, so a sample reads the same wherever it starts.
  std::size_t at = 4 + 4 + 8 + 4 + 4;
  for (std::uint32_t i = 0; i < count; ++i) {
    at = (at + 3) / 4 * 4;
    std::uint32_t length = 0;
    std::memcpy(&length, body.data() + at, sizeof length);
    samples.push_back(with_header(body.subspan(at, sizeof length + length)));
    at += sizeof length + length;
  }
  return samples;
}

template std::vector<std::vector<std::byte>> split_batch<wire::SampleBatch>(std::span<const std::byte> cdr);
template std::vector<std::vector<std::byte>> split_batch<wire::FlightBatch>(std::span<const std::byte> cdr);

}  // namespace trocar::capture
