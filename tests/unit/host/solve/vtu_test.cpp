#include "host/solve/vtu.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <sstream>
#include <stdexcept>

namespace trocar::host {
namespace {

// What the file says of one array, read back as a VTK reader would: offset from the XML, size and bytes behind the underscore.
template <class T>
std::vector<T> array(const std::string& file, const std::string& name) {
  const std::size_t at = file.find("Name=\"" + name + "\"");
  EXPECT_NE(at, std::string::npos) << name;
  const std::size_t offset = std::stoul(file.substr(file.find("offset=\"", at) + 8));
  const std::size_t data = file.find("<AppendedData encoding=\"raw\">\n_") + 31 + offset;
  std::uint64_t bytes = 0;
  std::memcpy(&bytes, file.data() + data, sizeof bytes);
  std::vector<T> values(bytes / sizeof(T));
  std::memcpy(values.data(), file.data() + data + 8, bytes);
  return values;
}

TEST(Vtu, ReadsBackAsItWasWritten) {
  const fem::Mesh mesh = fem::structured_grid(fem::uniform_grid(fem::Type::Tri3, {1.0, 2.0, 0.0}, {0.5, 0.25, 0.0}, {2, 2, 1}));
  std::ostringstream out;
  write_vtu(out, mesh, {{"displacement_m", 3, {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}}}, {{"young_pa", 1, {1e4, 2e4}}});
  const std::string file = out.str();
  EXPECT_NE(file.find("NumberOfPoints=\"4\" NumberOfCells=\"2\""), std::string::npos);
  EXPECT_EQ(array<double>(file, "position_m"), (std::vector<double>{1, 2, 0, 1.5, 2, 0, 1, 2.25, 0, 1.5, 2.25, 0}));
  EXPECT_EQ(array<std::int64_t>(file, "connectivity"), (std::vector<std::int64_t>{0, 1, 3, 0, 3, 2}));
  EXPECT_EQ(array<std::int64_t>(file, "offsets"), (std::vector<std::int64_t>{3, 6}));
  EXPECT_EQ(array<std::uint8_t>(file, "types"), (std::vector<std::uint8_t>{5, 5}));
  EXPECT_EQ(array<double>(file, "displacement_m").at(10), 11.0);
  EXPECT_EQ(array<double>(file, "young_pa"), (std::vector<double>{1e4, 2e4}));
  EXPECT_TRUE(file.ends_with("\n</AppendedData>\n</VTKFile>\n"));
}

TEST(Vtu, RefusesFieldsOfAnotherSize) {
  const fem::Mesh mesh = fem::structured_grid(fem::uniform_grid(fem::Type::Hex8, {}, {1, 1, 1}, {2, 2, 2}));
  std::ostringstream out;
  EXPECT_THROW(write_vtu(out, mesh, {{"u", 3, {1, 2, 3}}}, {}), std::invalid_argument);
  EXPECT_THROW(write_vtu(out, mesh, {}, {{"s", 1, {1, 2}}}), std::invalid_argument);
}

}  // namespace
}  // namespace trocar::host
