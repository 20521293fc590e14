#include "host/solve/vtu.hpp"

#include <fmt/format.h>

#include <bit>
#include <cstdint>
#include <ostream>
#include <span>
#include <stdexcept>

namespace trocar::host {
namespace {

static_assert(std::endian::native == std::endian::little, "the header below says little endian");

int cell_type(fem::Type type) {
  switch (type) {
    case fem::Type::Tri3:
      return 5;
    case fem::Type::Quad4:
      return 9;
    case fem::Type::Tet4:
      return 10;
    case fem::Type::Hex8:
      break;
  }
  return 12;
}

// Data blocks behind the XML, each after its size in bytes; the XML names them by their offsets.
class Appended {
 public:
  template <class T>
  std::string array(const char* vtk_type, const std::string& name, int components, const std::vector<T>& values) {
    std::string xml = fmt::format("<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" offset=\"{}\"/>\n",
                                  vtk_type, name, components, bytes_.size());
    const std::uint64_t size = values.size() * sizeof(T);
    append(&size, sizeof size);
    append(values.data(), size);
    return xml;
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  void append(const void* from, std::size_t size) { bytes_.append(static_cast<const char*>(from), size); }
  std::string bytes_;
};

}  // namespace

void write_vtu(std::ostream& stream, const fem::Mesh& mesh, const std::vector<Field>& points, const std::vector<Field>& cells) {
  Appended appended;
  const auto fields = [&](const std::vector<Field>& list, std::size_t count) {
    std::string xml;
    for (const Field& field : list) {
      if (field.value.size() != count * static_cast<std::size_t>(field.components))
        throw std::invalid_argument(fmt::format("field {} has {} values for {} places", field.name, field.value.size(), count));
      xml += appended.array("Float64", field.name, field.components, field.value);
    }
    return xml;
  };
  std::vector<double> place;
  for (const fem::Point& x : mesh.node) place.insert(place.end(), x.begin(), x.end());
  std::vector<std::int64_t> connectivity;
  std::vector<std::int64_t> offsets;
  const auto corners = static_cast<std::ptrdiff_t>(mesh.nodes_per_element());
  for (const auto& e : mesh.element) {
    connectivity.insert(connectivity.end(), e.begin(), e.begin() + corners);
    offsets.push_back(static_cast<std::int64_t>(connectivity.size()));
  }
  const std::vector<std::uint8_t> types(mesh.element.size(), static_cast<std::uint8_t>(cell_type(mesh.type)));

  stream
      << "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n"
      << fmt::format("<UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n", mesh.node.size(), mesh.element.size());
  stream << "<PointData>\n" << fields(points, mesh.node.size()) << "</PointData>\n";
  stream << "<CellData>\n" << fields(cells, mesh.element.size()) << "</CellData>\n";
  stream << "<Points>\n" << appended.array("Float64", "position_m", 3, place) << "</Points>\n";
  stream << "<Cells>\n"
         << appended.array("Int64", "connectivity", 1, connectivity) << appended.array("Int64", "offsets", 1, offsets)
         << appended.array("UInt8", "types", 1, types) << "</Cells>\n";
  stream << "</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_";
  stream.write(appended.bytes().data(), static_cast<std::streamsize>(appended.bytes().size()));
  stream << "\n</AppendedData>\n</VTKFile>\n";
}

}  // namespace trocar::host
