#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <future>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <thread>

#include "common/config/user_error.hpp"
#include "common/optics/frame_stream.hpp"
#include "host/camera/queue.hpp"
#include "host/camera/source.hpp"

namespace trocar::camera {
namespace {

using namespace std::chrono_literals;
using Status = Source::Status;

class Sources : public ::testing::Test {
 protected:
  Sources() {
    std::string name = (std::filesystem::temp_directory_path() / "trocar-sources-XXXXXX").string();  // mkdtemp fills in the Xs
    folder_ = ::mkdtemp(name.data());
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  }
  ~Sources() override { std::filesystem::remove_all(folder_); }
  std::string image(const char* name, int value, cv::Size size = {64, 48}, int type = CV_8UC1) const {
    const std::string path = (folder_ / name).string();
    cv::imwrite(path, cv::Mat(size, type, cv::Scalar(value, value + 1, value + 2)));
    return path;
  }
  static std::string refusal(const std::function<void()>& action) {
    try {
      action();
    } catch (const config::UserError& e) {
      return e.what();
    }
    return "";
  }
  std::filesystem::path folder_{};
  optics::Frame frame_{};
};

TEST_F(Sources, AFoldersImagesComeInTheOrderOfTheirNames) {
  image("b.png", 20);
  image("a.png", 10);
  image("c.png", 30);
  std::ofstream(folder_ / "notes.txt") << "not an image";
  const auto source = open_source({folder_.string()}, {.rate_hz = 10.0});
  EXPECT_EQ(source->clock(), Clock::Rate);
  for (int k = 0; k < 3; ++k) {
    ASSERT_EQ(source->next(frame_, 0ms), Status::Frame);
    EXPECT_EQ(frame_.number, static_cast<std::uint64_t>(k));
    EXPECT_EQ(frame_.time_ns, k * 100'000'000LL);
    EXPECT_EQ(frame_.pixels.at(0), 10 * (k + 1));
    EXPECT_EQ(frame_.format, optics::PixelFormat::Mono8);
  }
  EXPECT_EQ(source->next(frame_, 0ms), Status::End);
  EXPECT_EQ(source->counters().frames, 3u);
}

TEST_F(Sources, ColourIsRedGreenBlueAndGreyMayBeBayer) {
  const std::string colour = image("c.png", 50, {64, 48}, CV_8UC3), grey = image("g.png", 50);
  ASSERT_EQ(open_source({colour}, {})->next(frame_, 0ms), Status::Frame);
  EXPECT_EQ(frame_.format, optics::PixelFormat::Rgb8);
  EXPECT_EQ(frame_.pixels.at(0), 52);  // red came last in OpenCV's order
  EXPECT_EQ(frame_.pixels.at(2), 50);
  ASSERT_EQ(open_source({grey}, {.bayer = true})->next(frame_, 0ms), Status::Frame);
  EXPECT_EQ(frame_.format, optics::PixelFormat::BayerRG8);
}

TEST_F(Sources, ADamagedImageIsAGapByName) {
  const std::string a = image("a.png", 10), b = image("b.png", 20), c = image("c.png", 30);
  std::filesystem::resize_file(b, 40);
  const auto source = open_source({a, b, c}, {});
  ASSERT_EQ(source->next(frame_, 0ms), Status::Frame);
  ASSERT_EQ(source->next(frame_, 0ms), Status::Frame);
  EXPECT_EQ(frame_.number, 2u);
  const auto notices = source->notices();
  ASSERT_EQ(notices.size(), 1u);
  EXPECT_NE(notices[0].find("b.png: frame 1 is lost: truncated"), std::string::npos) << notices[0];
  EXPECT_EQ(source->counters().lost, 1u);
  EXPECT_EQ(source->next(frame_, 0ms), Status::End);
}

TEST_F(Sources, OtherSizesAndMissingFilesAreRefusedByName) {
  const std::string a = image("a.png", 10), b = image("b.png", 20, {32, 48});
  const auto source = open_source({a, b}, {});
  ASSERT_EQ(source->next(frame_, 0ms), Status::Frame);
  EXPECT_NE(refusal([&] { (void)source->next(frame_, 0ms); }).find("b.png: 32 x 48 px"), std::string::npos);
  EXPECT_NE(refusal([&] { (void)open_source({(folder_ / "none.png").string()}, {})->next(frame_, 0ms); }).find("no such file"),
            std::string::npos);
  std::filesystem::create_directory(folder_ / "empty");
  EXPECT_NE(refusal([&] { (void)open_source({(folder_ / "empty").string()}, {}); }).find("holds no images"), std::string::npos);
  EXPECT_NE(refusal([&] { (void)open_source({(folder_ / "none.avi").string()}, {}); }).find("no such file"), std::string::npos);
  std::ofstream(folder_ / "text.avi") << "no video";
  EXPECT_NE(refusal([&] { (void)open_source({(folder_ / "text.avi").string()}, {}); }).find("no video"), std::string::npos);
}

TEST_F(Sources, AVideoComesAtItsOwnRate) {
  const std::string path = (folder_ / "v.avi").string();
  {
    cv::VideoWriter writer(path, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25.0, {64, 48});
    ASSERT_TRUE(writer.isOpened());
    for (int k = 0; k < 5; ++k) writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar(20 * k, 20 * k, 20 * k)));
  }
  const auto source = open_source({path}, {});
  for (int k = 0; k < 5; ++k) {
    ASSERT_EQ(source->next(frame_, 0ms), Status::Frame);
    EXPECT_EQ(frame_.time_ns, k * 40'000'000LL);
    EXPECT_NEAR(frame_.pixels.at(0), 20 * k, 3);
  }
  EXPECT_EQ(source->next(frame_, 0ms), Status::End);
  EXPECT_EQ(source->counters().frames, 5u);
}

TEST_F(Sources, TheSimulatedCameraEndsOrDies) {
  const auto socket = folder_ / "camera";
  std::unique_ptr<Source> source;
  {
    optics::FrameServer server(socket, Clock::Rig);
    auto opened = std::async(std::launch::async, [&] { return open_source({"stream:" + socket.string()}, {}); });
    ASSERT_TRUE(server.wait_for_client(5s));
    source = opened.get();
    EXPECT_EQ(source->clock(), Clock::Rig);
    for (const std::uint64_t number : {3u, 4u, 7u})
      ASSERT_TRUE(server.send({.number = number, .width_px = 8, .height_px = 4, .pixels = std::vector<std::uint8_t>(32)}, 1s));
    for (int k = 0; k < 3; ++k) ASSERT_EQ(source->next(frame_, 1s), Status::Frame);
    EXPECT_EQ(source->counters().lost, 2u);
    EXPECT_EQ(source->notices().at(0), "frames 5 to 6 are lost");
    EXPECT_EQ(source->next(frame_, 1ms), Status::Timeout);
  }
  EXPECT_EQ(source->next(frame_, 1s), Status::End);
}

// Gives out numbered frames as fast as they are asked for, up to a number, then throws or ends.
class Counting : public Source {
 public:
  Counting(std::atomic<std::uint64_t>& given, std::uint64_t most, bool breaks) : given_(given), most_(most), breaks_(breaks) {}
  Status next(optics::Frame& frame, std::chrono::milliseconds) override {
    if (given_ == most_ && breaks_) throw config::UserError("the film tore");
    if (given_ == most_) return Status::End;
    frame.number = given_;
    frame.pixels.assign(16, 1);
    ++given_;
    return Status::Frame;
  }
  [[nodiscard]] SourceCounters counters() const override { return {given_, 0, 0}; }
  [[nodiscard]] Clock clock() const override { return Clock::Camera; }
  [[nodiscard]] std::string what() const override { return "counting"; }
  std::vector<std::string> notices() override { return {}; }

 private:
  std::atomic<std::uint64_t>& given_;
  std::uint64_t most_;
  bool breaks_;
};

TEST_F(Sources, AQueueDropsTheOldestAndSaysSo) {
  std::atomic<std::uint64_t> given{0};
  QueuedSource queue(std::make_unique<Counting>(given, 10, false), 4);
  while (given < 10) std::this_thread::yield();
  // All ten were read, by a thread that waits for nobody; which of them are left is known, but not when the last one is put in.
  std::vector<std::uint64_t> numbers;
  Status status = Status::Frame;
  while ((status = queue.next(frame_, 1s)) == Status::Frame) numbers.push_back(frame_.number);
  EXPECT_EQ(status, Status::End);
  ASSERT_GE(numbers.size(), 4u);
  EXPECT_LE(numbers.size(), 5u);  // one may be taken before the tenth arrives
  EXPECT_EQ(numbers.back(), 9u);
  for (std::size_t k = 1; k < numbers.size(); ++k) EXPECT_GT(numbers[k], numbers[k - 1]);
  const SourceCounters c = queue.counters();
  EXPECT_EQ(c.frames, numbers.size());
  EXPECT_EQ(c.frames + c.dropped, 10u);
  const auto notices = queue.notices();
  ASSERT_EQ(notices.size(), c.dropped);
  EXPECT_EQ(notices[0], "frame 0 is dropped: the queue of 4 is full");
}

TEST_F(Sources, AQueueHandsOutWhatCameBeforeAnError) {
  std::atomic<std::uint64_t> given{0};
  QueuedSource queue(std::make_unique<Counting>(given, 3, true), 4);
  for (std::uint64_t k = 0; k < 3; ++k) {
    ASSERT_EQ(queue.next(frame_, 1s), Status::Frame);
    EXPECT_EQ(frame_.number, k);
  }
  EXPECT_EQ(refusal([&] { (void)queue.next(frame_, 1s); }), "the film tore");
}

}  // namespace
}  // namespace trocar::camera
