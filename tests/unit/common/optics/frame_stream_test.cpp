#include "common/optics/frame_stream.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <future>
#include <memory>
#include <optional>
#include <thread>

#include "common/config/user_error.hpp"

namespace trocar::optics {
namespace {

using namespace std::chrono_literals;
using Status = FrameClient::Status;

class FrameStream : public ::testing::Test {
 protected:
  FrameStream() {
    std::string name = (std::filesystem::temp_directory_path() / "trocar-frames-XXXXXX").string();  // mkdtemp fills in the Xs
    folder_ = ::mkdtemp(name.data());
    socket_ = folder_ / "camera";
  }
  ~FrameStream() override { std::filesystem::remove_all(folder_); }
  static Frame frame(std::uint64_t number, int width = 320, int height = 200, PixelFormat format = PixelFormat::Mono8) {
    Frame f;
    f.number = number;
    f.time_ns = static_cast<std::int64_t>(number) * 1000;
    f.width_px = width;
    f.height_px = height;
    f.format = format;
    f.pixels.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * channels(format));
    for (std::size_t k = 0; k < f.pixels.size(); ++k) f.pixels[k] = static_cast<std::uint8_t>(k * 7 + number);
    return f;
  }
  // A client's socket without a client, or a server's end.
  [[nodiscard]] int raw_connection() const {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strcpy(address.sun_path, socket_.c_str());
    const int fd = ::socket(AF_UNIX, SOCK_STREAM, 0);
    EXPECT_EQ(::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    return fd;
  }
  // A client that was greeted.
  [[nodiscard]] std::unique_ptr<FrameClient> watch(FrameServer& server) const {
    auto client = std::async(std::launch::async, [this] { return std::make_unique<FrameClient>(socket_, 5s); });
    EXPECT_TRUE(server.wait_for_client(5s));
    return client.get();
  }
  std::filesystem::path folder_{}, socket_{};
};

TEST_F(FrameStream, FramesArriveWholeAndInOrder) {
  FrameServer server(socket_, Clock::Rig);
  struct stat file {};
  ASSERT_EQ(::stat(socket_.c_str(), &file), 0);
  EXPECT_EQ(file.st_mode & 0777U, 0600U);
  EXPECT_FALSE(server.send(frame(0), 10ms));  // nobody is there
  const auto client = watch(server);
  std::thread sender([&] {
    for (std::uint64_t k = 1; k <= 20; ++k)
      EXPECT_TRUE(server.send(frame(k, 640, 480, k % 2 == 0 ? PixelFormat::Rgb8 : PixelFormat::BayerRG8), 5s));
  });
  Frame got;
  for (std::uint64_t k = 1; k <= 20; ++k) {
    ASSERT_EQ(client->receive(got, 5s), Status::Frame);
    const Frame sent = frame(k, 640, 480, k % 2 == 0 ? PixelFormat::Rgb8 : PixelFormat::BayerRG8);
    EXPECT_EQ(got.number, k);
    EXPECT_EQ(got.time_ns, sent.time_ns);
    EXPECT_EQ(got.format, sent.format);
    EXPECT_EQ(got.pixels, sent.pixels);
  }
  sender.join();
  EXPECT_EQ(server.sent(), 20u);
  EXPECT_EQ(client->receive(got, 1ms), Status::Timeout);
}

TEST_F(FrameStream, ASlowClientIsDroppedAndNotWaitedFor) {
  FrameServer server(socket_, Clock::Rig);
  const int lazy = raw_connection();  // never reads
  const Frame large = frame(0, 2000, 2000);
  EXPECT_FALSE(server.send(large, 20ms));
  EXPECT_EQ(server.sent(), 0u);
  // The next one is served.
  const auto client = watch(server);
  std::thread sender([&] { EXPECT_TRUE(server.send(frame(1), 5s)); });
  Frame got;
  EXPECT_EQ(client->receive(got, 5s), Status::Frame);
  sender.join();
  ::close(lazy);
}

TEST_F(FrameStream, AServersEndIsToldFromItsDeath) {
  std::optional<FrameServer> server(std::in_place, socket_, Clock::Host);
  const auto client = watch(*server);
  EXPECT_EQ(client->clock(), Clock::Host);
  ASSERT_TRUE(server->send(frame(1), 1s));
  server.reset();
  Frame got;
  EXPECT_EQ(client->receive(got, 1s), Status::Frame);  // what came before is whole
  EXPECT_EQ(client->receive(got, 1s), Status::Closed);
  EXPECT_FALSE(std::filesystem::exists(socket_));
}

// What a server that is none says.
class Impostor {
 public:
  explicit Impostor(const std::filesystem::path& path) : listener_(::socket(AF_UNIX, SOCK_STREAM, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strcpy(address.sun_path, path.c_str());
    EXPECT_EQ(::bind(listener_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    EXPECT_EQ(::listen(listener_, 1), 0);
  }
  ~Impostor() { ::close(listener_); }
  void say(const std::vector<std::byte>& bytes) const {
    const int fd = ::accept(listener_, nullptr, nullptr);
    EXPECT_EQ(::send(fd, bytes.data(), bytes.size(), 0), static_cast<ssize_t>(bytes.size()));
    ::close(fd);
  }

 private:
  int listener_;
};

std::vector<std::byte> greeting(const char* magic, std::uint32_t clock) {
  std::vector<std::byte> out(16);
  std::memcpy(out.data(), magic, 8);
  std::memcpy(out.data() + 8, &clock, sizeof clock);
  return out;
}

std::vector<std::byte> head(const char* magic, std::uint32_t width, std::uint32_t height, std::uint32_t format, std::uint32_t bytes) {
  std::vector<std::byte> out(40);
  std::memcpy(out.data(), magic, 8);
  const std::uint32_t rest[] = {width, height, format, bytes};
  std::memcpy(out.data() + 24, rest, sizeof rest);
  return out;
}

TEST_F(FrameStream, WhatIsNoFrameIsForeignAndHalfAFrameBroken) {
  const Impostor server(socket_);
  const auto hears = [&](const std::vector<std::byte>& bytes) {
    std::vector<std::byte> all = greeting("trcamer1", 2);
    for (const std::byte b : bytes) all.push_back(b);
    const auto said = std::async(std::launch::async, [&] { server.say(all); });
    FrameClient client(socket_, 5s);
    EXPECT_EQ(client.clock(), Clock::Rig);
    Frame got;
    return client.receive(got, 1s);
  };
  EXPECT_EQ(hears(head("trframe2", 4, 4, 0, 16)), Status::Foreign);
  EXPECT_EQ(hears(head("trframe1", 4, 4, 7, 16)), Status::Foreign);
  EXPECT_EQ(hears(head("trframe1", 4, 4, 0, 17)), Status::Foreign);
  EXPECT_EQ(hears(head("trframe1", 0, 4, 0, 0)), Status::Foreign);
  EXPECT_EQ(hears(head("trframe1", 65536, 65536, 0, 0)), Status::Foreign);  // 2^32 bytes, which no field holds
  EXPECT_EQ(hears(head("trframe1", 4, 4, 0, 16)), Status::Broken);
  std::vector<std::byte> half = head("trframe1", 4, 4, 0, 16);
  half.resize(20);
  EXPECT_EQ(hears(half), Status::Broken);
}

TEST_F(FrameStream, WhoDoesNotGreetIsNoCamera) {
  const Impostor server(socket_);
  const auto refused = [&](const std::vector<std::byte>& bytes, const char* part) {
    const auto said = std::async(std::launch::async, [&] { server.say(bytes); });
    try {
      const FrameClient client(socket_, 5s);
      ADD_FAILURE() << part;
    } catch (const config::UserError& e) {
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
    }
  };
  refused(greeting("trcamer2", 0), "programs of one build");
  refused(greeting("trcamer1", 4), "programs of one build");
  refused({}, "does not greet");
}

TEST_F(FrameStream, ASecondWatcherIsTold) {
  FrameServer server(socket_, Clock::Rig);
  const auto first = watch(server);
  try {
    const FrameClient second(socket_, 50ms);
    ADD_FAILURE();
  } catch (const config::UserError& e) {
    EXPECT_NE(std::string(e.what()).find("another program watches it"), std::string::npos) << e.what();
  }
}

TEST_F(FrameStream, RefusesNamesAndPlacesThatCannotBe) {
  const auto refused = [](const std::filesystem::path& path, const char* part) {
    try {
      FrameServer server(path, Clock::Rig);
      ADD_FAILURE() << path;
    } catch (const config::UserError& e) {
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
    }
  };
  refused(folder_ / std::string(120, 'a'), "shorter path");
  refused(folder_ / "nowhere" / "camera", "no socket can be made there");
  std::ofstream(folder_ / "file") << "text";
  refused(folder_ / "file", "no socket");
  {
    FrameServer first(socket_, Clock::Rig);
    refused(socket_, "another camera is served there");
  }
  // One that a dead server left behind is replaced.
  { Impostor dead(socket_); }
  ASSERT_TRUE(std::filesystem::exists(socket_));
  FrameServer again(socket_, Clock::Rig);
  try {
    FrameClient nobody(folder_ / "none", 0ms);
    ADD_FAILURE();
  } catch (const config::UserError& e) {
    EXPECT_NE(std::string(e.what()).find("no camera is served there"), std::string::npos) << e.what();
  }
}

}  // namespace
}  // namespace trocar::optics
