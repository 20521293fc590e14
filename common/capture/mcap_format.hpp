// Numbers of the MCAP format, version 0 (mcap.dev/spec). Integers are little endian; a record is opcode u8, length u64, content.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace trocar::capture {

enum class Opcode : std::uint8_t {
  Header = 0x01,
  Footer = 0x02,
  Schema = 0x03,
  Channel = 0x04,
  Message = 0x05,
  Chunk = 0x06,
  MessageIndex = 0x07,
  ChunkIndex = 0x08,
  Statistics = 0x0B,
  SummaryOffset = 0x0E,
  DataEnd = 0x0F,
};

namespace mcap {
inline constexpr std::array<unsigned char, 8> magic{0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
inline constexpr std::size_t record_head = 1 + 8;
inline constexpr std::size_t data_end_record = record_head + 4;
inline constexpr std::size_t footer_record = record_head + 8 + 8 + 4;
}  // namespace mcap

struct Schema {
  std::uint16_t id{};
  std::string name;
  std::string encoding;
  std::string data;
};

struct Channel {
  std::uint16_t id{};
  std::uint16_t schema_id{};
  std::string topic;
  std::string message_encoding;
  std::map<std::string, std::string> metadata;
};

}  // namespace trocar::capture
