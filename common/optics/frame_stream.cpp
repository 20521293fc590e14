#include "common/optics/frame_stream.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <thread>

#include "common/config/user_error.hpp"

namespace trocar::optics {
namespace {

using Timer = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr std::array<char, 8> greeting_magic{'t', 'r', 'c', 'a', 'm', 'e', 'r', '1'};
struct Greeting {
  std::array<char, 8> magic{};
  std::uint32_t clock{}, reserved{};
};
static_assert(sizeof(Greeting) == 16);

constexpr std::array<char, 8> magic{'t', 'r', 'f', 'r', 'a', 'm', 'e', '1'};
struct Head {
  std::array<char, 8> magic{};
  std::uint64_t number{};
  std::int64_t time_ns{};
  std::uint32_t width_px{}, height_px{}, format{}, bytes{};
};
static_assert(sizeof(Head) == 40);

sockaddr_un address_of(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string text = path.string();
  if (text.empty() || text.size() >= sizeof address.sun_path)
    throw config::UserError(fmt::format("{}: a socket's name has 1 to {} bytes, this one has {}; take a shorter path", text,
                                        sizeof address.sun_path - 1, text.size()));
  std::memcpy(address.sun_path, text.c_str(), text.size() + 1);
  return address;
}

int remaining_ms(Timer::time_point end) {
  const auto left = std::chrono::duration_cast<milliseconds>(end - Timer::now()).count();
  return static_cast<int>(std::clamp<std::int64_t>(left, 0, 600'000));
}

bool ready(int fd, short events, Timer::time_point end) {
  pollfd p{fd, events, 0};
  int got = 0;
  do got = ::poll(&p, 1, remaining_ms(end));
  while (got < 0 && errno == EINTR);
  return got > 0;
}

bool connects(const sockaddr_un& address, int fd) {
  return fd >= 0 && ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
}

// As much as comes until then.
std::size_t read_some(int fd, void* into, std::size_t size, Timer::time_point end) {
  std::size_t have = 0;
  while (have < size) {
    const ssize_t n = ::recv(fd, static_cast<char*>(into) + have, size - have, MSG_DONTWAIT);
    if (n > 0)
      have += static_cast<std::size_t>(n);
    else if (n == 0 || (errno != EAGAIN && errno != EINTR) || !ready(fd, POLLIN, end))
      break;
  }
  return have;
}

// All of it, or false.
bool write_all(int fd, const void* data, std::size_t size, Timer::time_point end) {
  const auto* at = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t n = ::send(fd, at, size, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n > 0) {
      at += n;
      size -= static_cast<std::size_t>(n);
    } else if (errno == EAGAIN || errno == EINTR) {
      if (Timer::now() >= end || !ready(fd, POLLOUT, end)) return false;
    } else {
      return false;
    }
  }
  return true;
}

}  // namespace

FrameServer::FrameServer(std::filesystem::path path, Clock clock) : path_(std::move(path)), clock_(clock) {
  const sockaddr_un address = address_of(path_);
  const auto refuse = [this](const std::string& why) { throw config::UserError(fmt::format("{}: {}", path_.string(), why)); };
  struct stat there {};
  if (::lstat(path_.c_str(), &there) == 0) {
    if (!S_ISSOCK(there.st_mode)) refuse("is there already and no socket; name another one");
    const int probe = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const bool alive = connects(address, probe);
    ::close(probe);
    if (alive) refuse("another camera is served there; name another socket");
    ::unlink(path_.c_str());
  }
  listener_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const mode_t before = ::umask(0177);
  const bool bound = listener_ >= 0 && ::bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  const int error = errno;
  ::umask(before);
  if (!bound || ::listen(listener_, 1) != 0) {
    if (listener_ >= 0) ::close(listener_);
    refuse(fmt::format("no socket can be made there ({}); name one in a folder that exists and is yours", std::strerror(error)));
  }
}

FrameServer::~FrameServer() {
  for (const int fd : {client_, listener_})
    if (fd >= 0) ::close(fd);
  ::unlink(path_.c_str());
}

bool FrameServer::wait_for_client(milliseconds timeout) {
  if (client_ >= 0) return true;
  if (!ready(listener_, POLLIN, Timer::now() + timeout)) return false;
  client_ = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
  if (client_ < 0) return false;
  const Greeting greeting{greeting_magic, static_cast<std::uint32_t>(clock_), 0};
  if (write_all(client_, &greeting, sizeof greeting, Timer::now())) return true;  // a new socket has room for it
  ::close(client_);
  client_ = -1;
  return false;
}

bool FrameServer::send(const Frame& frame, milliseconds timeout) {
  if (!wait_for_client(milliseconds(0))) return false;
  const Head head{magic,
                  frame.number,
                  frame.time_ns,
                  static_cast<std::uint32_t>(frame.width_px),
                  static_cast<std::uint32_t>(frame.height_px),
                  static_cast<std::uint32_t>(frame.format),
                  static_cast<std::uint32_t>(frame.pixels.size())};
  const auto end = Timer::now() + timeout;
  if (write_all(client_, &head, sizeof head, end) && write_all(client_, frame.pixels.data(), frame.pixels.size(), end)) {
    ++sent_;
    return true;
  }
  ::close(client_);
  client_ = -1;
  return false;
}

FrameClient::FrameClient(const std::filesystem::path& path, milliseconds timeout) {
  const sockaddr_un address = address_of(path);
  const auto end = Timer::now() + timeout;
  while (true) {
    socket_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (connects(address, socket_)) break;
    const int error = errno;
    ::close(socket_);
    if (Timer::now() >= end)
      throw config::UserError(fmt::format("{}: no camera is served there ({}); start the simulation first, with --camera-socket {}",
                                          path.string(), std::strerror(error), path.string()));
    std::this_thread::sleep_for(milliseconds(20));
  }
  Greeting greeting;
  const std::size_t have = read_some(socket_, &greeting, sizeof greeting, end);
  const bool known = greeting.magic == greeting_magic && greeting.clock <= static_cast<std::uint32_t>(Clock::Rate);
  if (have < sizeof greeting || !known) {
    ::close(socket_);
    throw config::UserError(fmt::format("{}: {}", path.string(),
                                        have < sizeof greeting
                                            ? "the camera there does not greet: another program watches it, or it hangs; end that one first"
                                            : "what is served there is no camera of this version; use programs of one build"));
  }
  clock_ = static_cast<Clock>(greeting.clock);
  head_.resize(sizeof(Head));
}

FrameClient::~FrameClient() { ::close(socket_); }

FrameClient::Status FrameClient::receive(Frame& frame, milliseconds timeout) {
  const auto end = Timer::now() + timeout;
  while (true) {
    const bool in_head = have_ < sizeof(Head);
    const std::size_t wanted = in_head ? sizeof(Head) - have_ : sizeof(Head) + pixels_.size() - have_;
    void* into = in_head ? static_cast<void*>(head_.data() + have_) : static_cast<void*>(pixels_.data() + (have_ - sizeof(Head)));
    const ssize_t n = ::recv(socket_, into, wanted, MSG_DONTWAIT);
    if (n == 0) return have_ == 0 ? Status::Closed : Status::Broken;
    if (n < 0) {
      if (errno == EINTR) continue;
      if (errno != EAGAIN) return have_ == 0 ? Status::Closed : Status::Broken;
      if (!ready(socket_, POLLIN, end)) return Status::Timeout;
      continue;
    }
    have_ += static_cast<std::size_t>(n);
    if (in_head && have_ == sizeof(Head)) {
      Head head;
      std::memcpy(&head, head_.data(), sizeof head);
      const bool known = head.magic == magic && head.format <= static_cast<std::uint32_t>(PixelFormat::Rgb8) && head.width_px > 0 &&
                         head.height_px > 0 && head.width_px <= largest_side_px && head.height_px <= largest_side_px;
      const auto format = static_cast<PixelFormat>(head.format);
      if (!known || head.bytes != std::uint64_t{head.width_px} * head.height_px * channels(format)) return Status::Foreign;
      next_.number = head.number;
      next_.time_ns = head.time_ns;
      next_.width_px = static_cast<int>(head.width_px);
      next_.height_px = static_cast<int>(head.height_px);
      next_.format = format;
      pixels_.resize(head.bytes);
    }
    if (have_ < sizeof(Head) || have_ < sizeof(Head) + pixels_.size()) continue;
    have_ = 0;
    std::swap(frame.pixels, pixels_);  // the caller's storage serves the next frame
    frame.number = next_.number;
    frame.time_ns = next_.time_ns;
    frame.time_uncertainty_ns = 0;
    frame.arrived_ns = std::chrono::nanoseconds(Timer::now().time_since_epoch()).count();
    frame.width_px = next_.width_px;
    frame.height_px = next_.height_px;
    frame.format = next_.format;
    return Status::Frame;
  }
}

}  // namespace trocar::optics
