#include "common/image_file/visible_map.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>

#include "common/config/user_error.hpp"
#include "common/core/checksum.hpp"

namespace trocar::image_file {
namespace {

constexpr std::array<char, 8> magic{'T', 'R', 'O', 'C', 'A', 'R', 'V', 'M'};
constexpr std::uint32_t byte_order = 0x01020304;
constexpr std::uint32_t version = 1;

struct Header {
  std::array<char, 8> magic{};
  std::uint32_t byte_order{};
  std::uint32_t version{};
  std::uint64_t total_bytes{};
  std::uint32_t checksum{};  // CRC-32 of the whole file with zero in this field
  std::uint32_t image_checksum{};
  std::uint64_t nodes{};
  std::uint64_t faces{};
  std::uint64_t columns{};
  std::uint32_t dimension{};
  std::uint32_t reserved{};
};
static_assert(std::has_unique_object_representations_v<Header> && sizeof(Header) == 64);

struct Places {
  std::uint64_t node{}, face{}, compliance{}, end{};
};

constexpr std::uint64_t align(std::uint64_t offset) { return (offset + 63) / 64 * 64; }

Places places_of(std::uint64_t dimension, std::uint64_t nodes, std::uint64_t faces, std::uint64_t columns) {
  Places p;
  p.node = sizeof(Header);
  p.face = align(p.node + nodes * sizeof(std::array<double, 3>));
  p.compliance = align(p.face + faces * sizeof(Face));
  p.end = p.compliance + dimension * nodes * columns * sizeof(float);
  return p;
}

std::uint32_t checksum_of(std::span<const std::byte> bytes, Header header) {
  header.checksum = 0;
  return crc32(bytes.subspan(sizeof header), crc32(std::as_bytes(std::span(&header, 1))));
}

constexpr const char* again = "compile the scene again with --visible";

// What is wrong, or nothing.
const char* problem_of(std::span<const std::byte> bytes, Header& h) {
  if (bytes.size() < sizeof h) return "ends too early for a visible map";
  std::memcpy(&h, bytes.data(), sizeof h);
  if (h.magic != magic) return "is not a visible map";
  if (h.byte_order != byte_order) return "was compiled on a machine of the other byte order";
  if (h.version != version) return "was compiled by another version of trocar";
  if (h.total_bytes != bytes.size()) return "is shorter or longer than its header states";
  if (checksum_of(bytes, h) != h.checksum) return "is damaged: its checksum does not match";
  constexpr std::uint64_t most = std::uint64_t{1} << 24U;  // so that no size overflows
  if ((h.dimension != 2 && h.dimension != 3) || h.nodes > most || h.faces > most || h.columns > most) return "states impossible sizes";
  if (places_of(h.dimension, h.nodes, h.faces, h.columns).end != bytes.size()) return "has sections out of place";
  return nullptr;
}

const char* problem_of(const VisibleContent& c) {
  for (const auto& x : c.node_m)
    if (!std::all_of(x.begin(), x.end(), [](double v) { return std::isfinite(v); })) return "has a node that is not finite";
  for (const Face& face : c.face)
    for (std::size_t k = 0; k < 4; ++k)
      if (face[k] >= c.node_m.size() && !(k == 3 && face[k] == no_corner)) return "has a face of nodes that do not exist";
  if (!std::all_of(c.compliance.begin(), c.compliance.end(), [](float v) { return std::isfinite(v); }))
    return "has a compliance that is not finite";
  return nullptr;
}

template <typename T>
std::span<const T> view(std::span<const std::byte> bytes, std::uint64_t offset, std::uint64_t count) {
  return {reinterpret_cast<const T*>(bytes.data() + offset), static_cast<std::size_t>(count)};
}

}  // namespace

std::size_t visible_size(std::uint32_t dimension, std::size_t nodes, std::size_t faces, std::size_t columns) {
  return places_of(dimension, nodes, faces, columns).end;
}

void write_visible(const VisibleContent& c, std::span<std::byte> bytes) {
  const Places p = places_of(c.dimension, c.node_m.size(), c.face.size(), c.columns);
  std::memset(bytes.data(), 0, p.compliance);
  const auto put = [&](std::uint64_t at, auto values) {
    if (!values.empty()) std::memcpy(bytes.data() + at, values.data(), values.size_bytes());
  };
  put(p.node, c.node_m);
  put(p.face, c.face);
  put(p.compliance, c.compliance);
  Header header{.magic = magic,
                .byte_order = byte_order,
                .version = version,
                .total_bytes = p.end,
                .image_checksum = c.image_checksum,
                .nodes = c.node_m.size(),
                .faces = c.face.size(),
                .columns = c.columns,
                .dimension = c.dimension};
  header.checksum = checksum_of(bytes, header);
  std::memcpy(bytes.data(), &header, sizeof header);
}

VisibleMap::VisibleMap(const std::filesystem::path& file) : file_(file, Lock::No) {
  const auto fail = [&](const char* problem) { throw config::UserError(file.string() + ": " + problem + "; " + again); };
  Header h{};
  if (const char* problem = problem_of(file_.bytes(), h)) fail(problem);
  const Places p = places_of(h.dimension, h.nodes, h.faces, h.columns);
  content_ = {.image_checksum = h.image_checksum,
              .dimension = h.dimension,
              .node_m = view<std::array<double, 3>>(file_.bytes(), p.node, h.nodes),
              .face = view<Face>(file_.bytes(), p.face, h.faces),
              .columns = h.columns,
              .compliance = view<float>(file_.bytes(), p.compliance, h.dimension * h.nodes * h.columns)};
  if (const char* problem = problem_of(content_)) fail(problem);
}

void VisibleMap::displacements(std::span<const double> forces_n, std::span<double> u_m) const {
  std::fill(u_m.begin(), u_m.end(), 0.0);
  for (std::size_t column = 0; column < forces_n.size(); ++column) {
    const double force = forces_n[column];
    if (force == 0.0) continue;
    const float* const a = content_.compliance.data() + column * u_m.size();
    for (std::size_t i = 0; i < u_m.size(); ++i) u_m[i] += static_cast<double>(a[i]) * force;
  }
}

}  // namespace trocar::image_file
