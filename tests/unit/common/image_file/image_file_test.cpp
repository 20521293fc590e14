#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>

#include "common/config/user_error.hpp"
#include "common/core/checksum.hpp"
#include "common/image_file/mapped_image.hpp"
#include "common/image_file/visible_map.hpp"
#include "tiny_image.hpp"

namespace trocar::image_file {
namespace {

class Files : public ::testing::Test {
 protected:
  Files() { std::filesystem::create_directory(folder); }
  ~Files() override { std::filesystem::remove_all(folder); }

  std::filesystem::path put(std::span<const std::byte> bytes, const std::string& name = "file") const {
    std::ofstream(folder / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return folder / name;
  }
  // Message of the refusal, which begins with the path and holds a remedy.
  template <typename Load>
  static std::string refusal(const std::filesystem::path& path, const Load& load) {
    try {
      load(path);
    } catch (const config::UserError& error) {
      const std::string said = error.what();
      EXPECT_EQ(said.rfind(path.string() + ": ", 0), 0U) << said;
      EXPECT_NE(said.find(';'), std::string::npos) << said;
      return said;
    }
    ADD_FAILURE() << path << " was not refused";
    return {};
  }
  static std::string image_refusal(const std::filesystem::path& path) {
    return refusal(path, [](const auto& p) { (void)MappedImage(p); });
  }
  static std::string map_refusal(const std::filesystem::path& path) {
    return refusal(path, [](const auto& p) { (void)VisibleMap(p); });
  }

  const std::filesystem::path folder = std::filesystem::temp_directory_path() / ("trocar_image_file_" + std::to_string(getpid()));
};

// Three nodes in space, one face, four columns.
struct TinyMap {
  std::vector<std::array<double, 3>> node_m{{0.0, 0.0, 0.01}, {0.01, 0.0, 0.01}, {0.0, 0.01, 0.01}};
  std::vector<Face> face{{0, 1, 2, no_corner}};
  std::vector<float> compliance{};
  TinyMap() {
    for (int i = 0; i < 9 * 4; ++i) compliance.push_back(static_cast<float>(i + 1));
  }
  [[nodiscard]] AlignedBytes bytes() const {
    AlignedBytes out(visible_size(3, node_m.size(), face.size(), 4));
    write_visible({.image_checksum = 77, .dimension = 3, .node_m = node_m, .face = face, .columns = 4, .compliance = compliance},
                  out.span());
    return out;
  }
};

TEST_F(Files, MapsAnImage) {
  model::testing::TinyImage tiny;
  const auto bytes = tiny.bytes();
  for (const Lock lock : {Lock::No, Lock::Yes}) {
    const MappedImage mapped(put(bytes.span()), lock);
    EXPECT_EQ(mapped.image().tissue.node_m.size(), 9U);
    EXPECT_TRUE(std::ranges::equal(mapped.bytes(), bytes.span()));
  }
}

TEST_F(Files, ALockedImageOutlivesWhatIsDoneToItsFile) {
  model::testing::TinyImage tiny;
  const auto bytes = tiny.bytes();
  const auto path = put(bytes.span());
  const MappedImage locked(path, Lock::Yes);
  std::filesystem::resize_file(path, 0);
  put({bytes.span().first(100)});
  EXPECT_TRUE(std::ranges::equal(locked.bytes(), bytes.span()));
  EXPECT_EQ(locked.image().law->shaft_n_per_m, 34.0);
}

TEST_F(Files, MappedImageMoves) {
  model::testing::TinyImage tiny;
  MappedImage first(put(tiny.bytes().span(), "first"));
  tiny.image.needle.length_m = 0.2;
  MappedImage second(put(tiny.bytes().span(), "second"));
  first = std::move(second);
  EXPECT_EQ(first.image().needle.length_m, 0.2);
  EXPECT_EQ(first.image().law->shaft_n_per_m, 34.0);
}

TEST_F(Files, RefusesWhatIsNoImageByName) {
  model::testing::TinyImage tiny;
  const auto bytes = tiny.bytes();
  EXPECT_NE(image_refusal(folder / "nothing").find("No such file"), std::string::npos);
  EXPECT_NE(image_refusal(folder).find("regular file"), std::string::npos);
  EXPECT_NE(image_refusal(put({})).find("too early"), std::string::npos);
  EXPECT_NE(image_refusal(put(bytes.span().first(bytes.span().size() - 1))).find("too early"), std::string::npos);
  bytes.span()[700] ^= std::byte{4};
  EXPECT_NE(image_refusal(put(bytes.span())).find("damaged"), std::string::npos);
  const TinyMap map;
  EXPECT_NE(image_refusal(put(map.bytes().span())).find("not a model image"), std::string::npos);
}

TEST_F(Files, VisibleMapTurnsForcesIntoDisplacements) {
  const TinyMap tiny;
  const VisibleMap map(put(tiny.bytes().span()));
  EXPECT_EQ(map.content().image_checksum, 77U);
  EXPECT_EQ(map.content().face[0], (Face{0, 1, 2, no_corner}));
  EXPECT_EQ(map.content().node_m[1], (std::array<double, 3>{0.01, 0.0, 0.01}));
  std::vector<double> u(9, -1.0);
  map.displacements(std::vector<double>{2.0, 0.0, 0.0, -1.0}, u);
  for (std::size_t i = 0; i < 9; ++i) EXPECT_EQ(u[i], 2.0 * static_cast<double>(i + 1) - static_cast<double>(27 + i + 1));
}

TEST_F(Files, DamagedVisibleMapsAreRefused) {
  const TinyMap tiny;
  AlignedBytes bytes = tiny.bytes();
  const std::vector<std::byte> good(bytes.span().begin(), bytes.span().end());
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::vector<std::byte> bad = good;
    bad[i] ^= std::byte{1};
    (void)map_refusal(put(bad));
  }
  for (std::size_t size = 0; size < good.size(); ++size) (void)map_refusal(put(std::span(good).first(size)));
}

TEST_F(Files, HostileVisibleMapsAreRefused) {
  const auto change = [&](const std::function<void(TinyMap&)>& what) {
    TinyMap tiny;
    what(tiny);
    return map_refusal(put(tiny.bytes().span()));
  };
  EXPECT_NE(change([](auto& t) { t.node_m[2][1] = std::numeric_limits<double>::infinity(); }).find("node"), std::string::npos);
  EXPECT_NE(change([](auto& t) { t.face[0][1] = 3; }).find("face"), std::string::npos);
  EXPECT_NE(change([](auto& t) { t.face[0][2] = no_corner; }).find("face"), std::string::npos);
  EXPECT_NE(change([](auto& t) { t.compliance[35] = std::numeric_limits<float>::quiet_NaN(); }).find("compliance"), std::string::npos);
  // Sizes that would overflow, with a checksum that matches.
  const TinyMap tiny;
  for (const std::size_t field : {32U, 40U, 48U}) {
    AlignedBytes bytes = tiny.bytes();
    for (const std::uint64_t count : {std::uint64_t{1} << 62U, ~std::uint64_t{0}, std::uint64_t{0}}) {
      std::memcpy(bytes.span().data() + field, &count, 8);
      std::memset(bytes.span().data() + 24, 0, 4);
      const std::uint32_t crc = crc32(bytes.span());
      std::memcpy(bytes.span().data() + 24, &crc, 4);
      (void)map_refusal(put(bytes.span()));
    }
  }
}

}  // namespace
}  // namespace trocar::image_file
