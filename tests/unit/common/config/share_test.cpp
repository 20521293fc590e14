#include "common/config/share.hpp"

#include "file_fixture.hpp"

namespace trocar::config {
namespace {

using testing::expect_parts;

class ShareTest : public testing::FileFixture {};

TEST_F(ShareTest, FindsAShippedFileByName) {
  const auto file = find_share("rigs", "ubc_twin");
  EXPECT_EQ(file, share_folder() / "rigs" / "ubc_twin.toml");
  EXPECT_TRUE(std::filesystem::exists(file)) << file;
}

TEST_F(ShareTest, TakesPathsAsTheyAre) {
  EXPECT_EQ(find_share("rigs", "./mine"), "./mine");
  EXPECT_EQ(find_share("rigs", "mine.toml"), "mine.toml");
}

TEST_F(ShareTest, NamesThePlaceAndWhatIsThere) {
  expect_parts(error_from([] { static_cast<void>(find_share("rigs", "ubc_twn")); }),
               {"ubc_twn: nothing of this name in ", "/share/trocar/rigs", "did you mean ubc_twin?", "five_bar, ubc_twin, ubc_twin_haptic",
                "./ubc_twn.toml"});
  expect_parts(error_from([] { static_cast<void>(find_share("nothing", "x")); }),
               {"x: nothing of this name in ", "write a path such as ./x.toml"});
  expect_parts(error_from([] { static_cast<void>(find_share("rigs", "")); }), {"write one of"});
}

}  // namespace
}  // namespace trocar::config
