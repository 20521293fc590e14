#include "host/camera/image.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>

#include "common/config/user_error.hpp"
#include "photographs.hpp"

namespace trocar::camera {
namespace {

class ImageTest : public ::testing::Test {
 protected:
  ImageTest() {
    std::string pattern = (std::filesystem::temp_directory_path() / "trocar_image_XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
  }
  ~ImageTest() override { std::filesystem::remove_all(folder_); }
  // What reading these bytes ends in: "" for an image.
  std::string damage_of(const std::vector<unsigned char>& bytes) const {
    const auto file = folder_ / "image";
    std::ofstream(file, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    try {
      for (const Colour colour : {Colour::Grey, Colour::AsStored}) (void)read_image(file, colour);
    } catch (const DamagedImage& e) {
      return e.what();
    }
    return {};
  }
  std::filesystem::path folder_;
};

TEST_F(ImageTest, NamesAnImageThatIsCutAnywhere) {
  for (const char* format : {".png", ".jpg", ".bmp", ".pgm", ".tiff"}) {
    std::vector<unsigned char> whole;
    ASSERT_TRUE(cv::imencode(format, drawn_board(9, 6), whole));
    EXPECT_EQ(damage_of(whole), "") << format;
    for (const double part : {0.0, 0.001, 0.1, 0.5, 0.9, 0.99}) {
      const auto size = static_cast<std::size_t>(part * static_cast<double>(whole.size()));
      EXPECT_NE(damage_of({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)}), "")
          << format << " cut after " << size << " bytes";
    }
  }
  std::ifstream file(photographs()[0], std::ios::binary);
  const std::vector<unsigned char> photograph{std::istreambuf_iterator<char>(file), {}};
  EXPECT_EQ(damage_of(photograph), "");
  for (const std::size_t missing : {1U, 2U, 100U, 20000U})
    EXPECT_NE(damage_of({photograph.begin(), photograph.end() - static_cast<std::ptrdiff_t>(missing)}).find("truncated"), std::string::npos)
        << missing;
}

TEST_F(ImageTest, NamesAJpegThatIsCorruptInItsMiddle) {
  std::ifstream file(photographs()[0], std::ios::binary);
  std::vector<unsigned char> photograph{std::istreambuf_iterator<char>(file), {}};
  std::fill(photograph.begin() + 9000, photograph.begin() + 12000, static_cast<unsigned char>(0));
  EXPECT_NE(damage_of(photograph).find("corrupt"), std::string::npos);
}

TEST_F(ImageTest, RefusesWhatCannotBeRead) {
  for (const auto& file : {folder_ / "none.png", folder_, std::filesystem::path("/dev/null")})
    EXPECT_THROW((void)read_image(file, Colour::Grey), config::UserError) << file;
  const std::string text = "this is no image";
  EXPECT_NE(damage_of({text.begin(), text.end()}), "");
}

}  // namespace
}  // namespace trocar::camera
