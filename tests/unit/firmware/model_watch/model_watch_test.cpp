#include "firmware/model_watch/model_watch.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <mutex>
#include <vector>

#include "common/config/user_error.hpp"
#include "tiny_image.hpp"

namespace trocar::model_watch {
namespace {

class ModelWatchTest : public ::testing::Test {
 protected:
  ModelWatchTest() { std::filesystem::create_directory(folder_); }
  ~ModelWatchTest() override { std::filesystem::remove_all(folder_); }

  // As `trocar scene compile` does: written aside, then renamed.
  void replace(std::span<const std::byte> bytes) const {
    const auto aside = folder_ / "aside";
    std::ofstream(aside, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    std::filesystem::rename(aside, file_);
  }
  void replace(double needle_length_m) {
    model::testing::TinyImage tiny;
    tiny.image.needle.length_m = needle_length_m;
    replace(tiny.bytes().span());
  }
  ModelWatch::Say say() {
    return [this](const std::string& line) {
      const std::scoped_lock lock(mutex_);
      said_.push_back(line);
    };
  }
  std::string wait_for_line(std::size_t number) {
    for (int i = 0; i < 1000; ++i) {
      {
        const std::scoped_lock lock(mutex_);
        if (said_.size() >= number) return said_[number - 1];
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return "(nothing was said)";
  }
  double length_in_use() {
    EXPECT_TRUE(needle_.ready());
    return needle_.using_image()->needle.length_m;
  }

  std::filesystem::path folder_ = std::filesystem::temp_directory_path() / ("trocar_model_watch_" + std::to_string(getpid()));
  std::filesystem::path file_ = folder_ / "model.image";
  virtual_needle::VirtualNeedle needle_;
  std::mutex mutex_;
  std::vector<std::string> said_;
};

TEST_F(ModelWatchTest, TakesWhatReplacesTheImageAndNothingDamaged) {
  replace(0.1);
  const ModelWatch watch(file_, needle_, say());
  EXPECT_EQ(length_in_use(), 0.1);

  model::testing::TinyImage tiny;
  const auto damaged = tiny.bytes();
  damaged.span()[700] ^= std::byte{4};
  replace(damaged.span());
  EXPECT_NE(wait_for_line(1).find("damaged"), std::string::npos) << wait_for_line(1);
  EXPECT_NE(wait_for_line(1).find("the model that runs stays"), std::string::npos);
  EXPECT_EQ(length_in_use(), 0.1);

  replace(0.2);
  EXPECT_NE(wait_for_line(2).find("taken"), std::string::npos) << wait_for_line(2);
  EXPECT_EQ(length_in_use(), 0.2);

  // Two that the needle never looks at, and one that it takes.
  replace(0.3);
  (void)wait_for_line(3);
  replace(0.4);
  EXPECT_NE(wait_for_line(4).find("taken"), std::string::npos) << wait_for_line(4);
  EXPECT_EQ(length_in_use(), 0.4);

  // Gone: the last one goes on.
  std::filesystem::remove(file_);
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  EXPECT_EQ(length_in_use(), 0.4);
  const std::scoped_lock lock(mutex_);
  EXPECT_EQ(said_.size(), 4U);
}

TEST_F(ModelWatchTest, RefusesToStartWithoutAnImage) {
  EXPECT_THROW(ModelWatch(file_, needle_, say()), config::UserError);
  EXPECT_FALSE(needle_.ready());
}

}  // namespace
}  // namespace trocar::model_watch
