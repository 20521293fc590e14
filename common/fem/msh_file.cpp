#include "common/fem/msh_file.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <string_view>
#include <system_error>

namespace trocar::fem {
namespace {

// Reads numbers one after the other, as digits or as bytes. Every failure is an Error with the place.
class Reader {
 public:
  Reader(std::string name, std::string text) : name_(std::move(name)), text_(std::move(text)) {}

  [[noreturn]] void fail(const std::string& problem) const {
    std::string place = name_;
    const std::string_view before = std::string_view(text_).substr(0, std::min(mark_, text_.size()));
    if (binary)
      place += ", byte " + std::to_string(mark_);
    else
      place += ":" + std::to_string(1 + std::count(before.begin(), before.end(), '\n'));
    place += ": ";
    // What a problem quotes from a damaged file may hold anything; a terminal shall not act on it.
    for (const char c : problem) place += static_cast<unsigned char>(c) < 0x20 || c == 0x7F ? '?' : c;
    throw Error(place);
  }

  bool binary{false};

  // The next line that is not empty, without its end; empty at the end of the file.
  std::string_view line() {
    while (at_ < text_.size()) {
      mark_ = at_;
      const std::size_t end = std::min(text_.find('\n', at_), text_.size());
      std::string_view found(text_.data() + at_, end - at_);
      at_ = std::min(end + 1, text_.size());  // the last line may have no end
      while (!found.empty() && (found.back() == '\r' || found.back() == ' ')) found.remove_suffix(1);
      if (!found.empty()) return found;
    }
    mark_ = text_.size();
    return {};
  }
  // Behind a count in digits, before binary data.
  void end_of_line() { at_ = std::min(text_.find('\n', at_), text_.size() - 1) + 1; }

  std::int64_t integer(const char* what) { return binary ? bytes<std::int32_t>(what) : digits<std::int64_t>(what); }
  // A count or tag of format 4: eight bytes.
  std::int64_t wide(const char* what) {
    if (!binary) return digits<std::int64_t>(what);
    const auto value = bytes<std::uint64_t>(what);
    if (value > (std::uint64_t{1} << 62)) fail(std::string(what) + " is out of range; the file is damaged");
    return static_cast<std::int64_t>(value);
  }
  double real(const char* what) {
    const double value = binary ? bytes<double>(what) : digits<double>(what);
    if (!std::isfinite(value)) fail(std::string(what) + " is not a finite number");
    return value;
  }
  // How many items follow; more than the rest of the file could hold are refused before anything is stored.
  std::int64_t count(std::int64_t value, const char* what) const {
    if (value < 0 || static_cast<std::uint64_t>(value) > text_.size() - at_)
      fail(std::to_string(value) + " " + what + " do not fit in the rest of the file; it is damaged or was cut short");
    return value;
  }

  // $Name … $EndName
  void end_section(std::string_view name) {
    const std::string wanted = "$End" + std::string(name);
    const std::string_view found = line();
    if (found != wanted) fail("expected " + wanted + "; the file is damaged or was cut short");
  }
  void skip_section(std::string_view name) {
    const std::size_t end = text_.find("$End" + std::string(name), at_);
    if (end == std::string::npos) fail("the section $" + std::string(name) + " does not end; the file was cut short");
    at_ = end;
    (void)line();
  }
  // "…" after a number, on the same line.
  std::string quoted() {
    const std::string_view rest = line();
    const std::size_t open = rest.find('"');
    const std::size_t close = rest.rfind('"');
    if (open == std::string_view::npos || close == open) fail("expected a name in quotes");
    const std::string_view found = rest.substr(open + 1, close - open - 1);
    for (const char c : found)
      if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) fail("a name holds a control character; name the group anew");
    return std::string(found);
  }

 private:
  template <class T>
  T digits(const char* what) {
    while (at_ < text_.size() && std::strchr(" \t\r\n", text_[at_]) != nullptr) ++at_;
    mark_ = at_;
    T value{};
    const char* const begin = text_.data() + at_;
    const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), value);
    const bool ends = end == text_.data() + text_.size() || std::strchr(" \t\r\n", *end) != nullptr;
    if (error != std::errc() || !ends) fail(std::string("expected ") + what + (at_ == text_.size() ? "; the file was cut short" : ""));
    at_ += static_cast<std::size_t>(end - begin);
    return value;
  }
  template <class T>
  T bytes(const char* what) {
    mark_ = at_;
    if (at_ + sizeof(T) > text_.size()) fail(std::string("expected ") + what + "; the file was cut short");
    T value{};
    std::memcpy(&value, text_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }

  std::string name_;
  std::string text_;
  std::size_t at_{};
  std::size_t mark_{};  // where what was read last begins
};

using Entities = std::map<std::pair<int, std::int64_t>, std::vector<int>>;  // (dimension, tag) to physical groups

bool read_format(Reader& in) {
  const std::string version(in.line());
  double number = 0.0;
  int kind = -1;
  int size = 0;
  // A number too large for its type is none of those asked for below.
  if (std::sscanf(version.c_str(), "%lf %d %d", &number, &kind, &size) != 3 || (kind != 0 && kind != 1))  // NOLINT(cert-err34-c)
    in.fail("expected version, file type and data size after $MeshFormat");
  if (number != 2.2 && number != 4.1)
    in.fail("format " + version.substr(0, version.find(' ')) + " is not read; save the mesh as version 4.1 or 2.2");
  if (size != 8) in.fail("a data size of " + std::to_string(size) + " is not read; save the mesh with 8");
  if (kind == 1) {
    in.binary = true;
    if (in.integer("the mark of the byte order") != 1)
      in.fail("numbers are big endian; save the mesh on a little-endian machine or as ASCII");
  }
  in.end_section("MeshFormat");
  return number == 4.1;
}

// Always digits, in binary files too.
void read_physical_names(Reader& in, MshFile& mesh) {
  const bool binary = std::exchange(in.binary, false);
  const std::int64_t names = in.count(in.integer("the number of physical names"), "names");
  for (std::int64_t i = 0; i < names; ++i) {
    const auto dimension = static_cast<int>(in.integer("the dimension of a physical name"));
    const auto number = static_cast<int>(in.integer("the number of a physical group"));
    mesh.physical_name[{dimension, number}] = in.quoted();
  }
  in.binary = binary;
  in.end_section("PhysicalNames");
}

void read_entities(Reader& in, Entities& entities) {
  std::array<std::int64_t, 4> counts{};
  for (auto& count : counts) count = in.count(in.wide("a number of entities"), "entities");
  for (int dimension = 0; dimension < 4; ++dimension)
    for (std::int64_t i = 0; i < counts[static_cast<std::size_t>(dimension)]; ++i) {
      const std::int64_t tag = in.integer("the tag of an entity");
      for (int k = 0; k < (dimension == 0 ? 3 : 6); ++k) (void)in.real("a coordinate of an entity");
      std::vector<int>& groups = entities[{dimension, tag}];
      const std::int64_t physical = in.count(in.wide("a number of physical groups"), "physical groups");
      for (std::int64_t k = 0; k < physical; ++k) groups.push_back(static_cast<int>(std::abs(in.integer("a physical group"))));
      if (dimension == 0) continue;
      const std::int64_t bounding = in.count(in.wide("a number of bounding entities"), "bounding entities");
      for (std::int64_t k = 0; k < bounding; ++k) (void)in.integer("a bounding entity");
    }
  in.end_section("Entities");
}

void read_nodes_2(Reader& in, MshFile& mesh) {
  const bool binary = std::exchange(in.binary, false);  // counts are digits
  const std::int64_t nodes = in.count(in.integer("the number of nodes"), "nodes");
  in.end_of_line();
  in.binary = binary;
  for (std::int64_t i = 0; i < nodes; ++i) {
    mesh.node_tag.push_back(in.integer("the number of a node"));
    Point& x = mesh.node.emplace_back();
    for (double& coordinate : x) coordinate = in.real("a coordinate");
  }
  in.end_section("Nodes");
}

void read_nodes_4(Reader& in, MshFile& mesh) {
  const std::int64_t blocks = in.count(in.wide("the number of node blocks"), "node blocks");
  const std::int64_t nodes = in.count(in.wide("the number of nodes"), "nodes");
  (void)in.wide("the least node tag");
  (void)in.wide("the largest node tag");
  for (std::int64_t b = 0; b < blocks; ++b) {
    const std::int64_t dimension = in.integer("the dimension of a node block");
    (void)in.integer("the entity of a node block");
    const bool parametric = in.integer("whether nodes are parametric") != 0;
    const std::int64_t here = in.count(in.wide("the number of nodes in a block"), "nodes");
    for (std::int64_t i = 0; i < here; ++i) mesh.node_tag.push_back(in.wide("the tag of a node"));
    for (std::int64_t i = 0; i < here; ++i) {
      Point& x = mesh.node.emplace_back();
      for (double& coordinate : x) coordinate = in.real("a coordinate");
      for (std::int64_t k = 0; parametric && k < dimension; ++k) (void)in.real("a parametric coordinate");
    }
  }
  if (static_cast<std::int64_t>(mesh.node.size()) != nodes)
    in.fail(std::to_string(mesh.node.size()) + " nodes in the blocks, " + std::to_string(nodes) + " announced; the file is damaged");
  in.end_section("Nodes");
}

int known_type(const Reader& in, std::int64_t type) {
  if (type < 1 || type > 1000 || msh_type(static_cast<int>(type)).nodes == 0)
    in.fail("element type " + std::to_string(type) + " is not read; use linear triangles, quadrilaterals, tetrahedra or hexahedra");
  return static_cast<int>(type);
}

void read_element_nodes(Reader& in, MshElement& element) {
  for (int k = 0; k < msh_type(element.type).nodes; ++k) element.node.push_back(in.integer("a node of an element"));
}

// The first tag is the physical group, 0 for none.
void read_tags_2(Reader& in, std::int64_t tags, MshElement& element) {
  if (tags < 0 || tags > 1000) in.fail(std::to_string(tags) + " tags of an element; the file is damaged");
  for (std::int64_t k = 0; k < tags; ++k) {
    const std::int64_t tag = in.integer("a tag of an element");
    if (k == 0 && tag != 0) element.physical.push_back(static_cast<int>(std::abs(tag)));
  }
}

void read_elements_2(Reader& in, MshFile& mesh) {
  const bool binary = std::exchange(in.binary, false);
  const std::int64_t elements = in.count(in.integer("the number of elements"), "elements");
  in.end_of_line();
  in.binary = binary;
  while (static_cast<std::int64_t>(mesh.element.size()) < elements) {
    if (!binary) {
      (void)in.integer("the number of an element");
      MshElement& element = mesh.element.emplace_back();
      element.type = known_type(in, in.integer("the type of an element"));
      read_tags_2(in, in.integer("the number of tags"), element);
      read_element_nodes(in, element);
      continue;
    }
    const int type = known_type(in, in.integer("the type of elements"));
    const std::int64_t here = in.count(in.integer("the number of elements of a type"), "elements");
    const std::int64_t tags = in.integer("the number of tags");
    if (here == 0 || here > elements - static_cast<std::int64_t>(mesh.element.size()))
      in.fail("a block of " + std::to_string(here) + " elements; the file is damaged");
    for (std::int64_t i = 0; i < here; ++i) {
      (void)in.integer("the number of an element");
      MshElement& element = mesh.element.emplace_back();
      element.type = type;
      read_tags_2(in, tags, element);
      read_element_nodes(in, element);
    }
  }
  in.end_section("Elements");
}

void read_elements_4(Reader& in, const Entities& entities, MshFile& mesh) {
  const std::int64_t blocks = in.count(in.wide("the number of element blocks"), "element blocks");
  const std::int64_t elements = in.count(in.wide("the number of elements"), "elements");
  (void)in.wide("the least element tag");
  (void)in.wide("the largest element tag");
  for (std::int64_t b = 0; b < blocks; ++b) {
    const auto dimension = static_cast<int>(in.integer("the dimension of an element block"));
    const std::int64_t entity = in.integer("the entity of an element block");
    const int type = known_type(in, in.integer("the type of elements"));
    const std::int64_t here = in.count(in.wide("the number of elements in a block"), "elements");
    const auto found = entities.find({dimension, entity});
    for (std::int64_t i = 0; i < here; ++i) {
      (void)in.wide("the tag of an element");
      MshElement& element = mesh.element.emplace_back();
      element.type = type;
      if (found != entities.end()) element.physical = found->second;
      for (int k = 0; k < msh_type(type).nodes; ++k) element.node.push_back(in.wide("a node of an element"));
    }
  }
  if (static_cast<std::int64_t>(mesh.element.size()) != elements)
    in.fail(std::to_string(mesh.element.size()) + " elements in the blocks, " + std::to_string(elements) +
            " announced; the file is damaged");
  in.end_section("Elements");
}

}  // namespace

MshType msh_type(int number) {
  switch (number) {
    case 1:
      return {1, 2, "lines"};
    case 2:
      return {2, 3, "triangles"};
    case 3:
      return {2, 4, "quadrilaterals"};
    case 4:
      return {3, 4, "tetrahedra"};
    case 5:
      return {3, 8, "hexahedra"};
    case 6:
      return {3, 6, "prisms"};
    case 7:
      return {3, 5, "pyramids"};
    case 8:
      return {1, 3, "quadratic lines"};
    case 9:
      return {2, 6, "quadratic triangles"};
    case 10:
      return {2, 9, "quadratic quadrilaterals"};
    case 11:
      return {3, 10, "quadratic tetrahedra"};
    case 12:
      return {3, 27, "quadratic hexahedra"};
    case 13:
      return {3, 18, "quadratic prisms"};
    case 14:
      return {3, 14, "quadratic pyramids"};
    case 15:
      return {0, 1, "points"};
    case 16:
      return {2, 8, "quadratic quadrilaterals"};
    case 17:
      return {3, 20, "quadratic hexahedra"};
    case 18:
      return {3, 15, "quadratic prisms"};
    case 19:
      return {3, 13, "quadratic pyramids"};
    default:
      return {};
  }
}

MshFile read_msh(const std::filesystem::path& file) {
  const std::string name = file.string();
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (status.type() == std::filesystem::file_type::not_found)
    throw Error(name + ": there is no such file; mesh files are looked for beside the scene");
  if (status.type() != std::filesystem::file_type::regular) throw Error(name + ": not a file; name a gmsh mesh");
  std::ifstream stream(file, std::ios::binary);
  std::string text(static_cast<std::size_t>(std::filesystem::file_size(file)), '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (!stream) throw Error(name + ": cannot be read; check its permissions");

  Reader in(name, std::move(text));
  MshFile mesh;
  Entities entities;
  bool format = false;
  bool version_4 = false;
  bool nodes = false;
  bool elements = false;
  for (;;) {
    const std::string_view found = in.line();
    if (found.empty()) break;
    const std::string section(found.substr(0, 40));
    if (!format && section != "$MeshFormat" && section != "$Comments") in.fail("not a gmsh mesh: it should begin with $MeshFormat");
    if (section == "$MeshFormat") {
      version_4 = read_format(in);
      format = true;
    } else if (section == "$PhysicalNames") {
      read_physical_names(in, mesh);
    } else if (section == "$Entities") {
      read_entities(in, entities);
    } else if (section == "$PartitionedEntities") {
      in.fail("the mesh is partitioned; save it in one piece");
    } else if (section == "$Nodes" && !nodes) {
      version_4 ? read_nodes_4(in, mesh) : read_nodes_2(in, mesh);
      nodes = true;
    } else if (section == "$Elements" && !elements) {
      version_4 ? read_elements_4(in, entities, mesh) : read_elements_2(in, mesh);
      elements = true;
    } else if (section.starts_with("$") && !section.starts_with("$End") && section != "$Nodes" && section != "$Elements") {
      in.skip_section(std::string_view(section).substr(1));
    } else {
      in.fail("expected the beginning of a section, such as $Nodes, and each but once; the file is damaged");
    }
  }
  if (!format || !nodes || !elements)
    in.fail(std::string("the section ") +
            (!format  ? "$MeshFormat"
             : !nodes ? "$Nodes"
                      : "$Elements") +
            " is missing; the file was cut short");
  return mesh;
}

}  // namespace trocar::fem
