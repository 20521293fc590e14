#include "hal/can/udp_bus.hpp"

#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace trocar::hal {
namespace {

bool resolve(const char* host, std::uint16_t port, sockaddr_in& address) noexcept {
  addrinfo hints{};
  hints.ai_family = AF_INET;
  hints.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  if (::getaddrinfo(host, nullptr, &hints, &found) != 0 || found == nullptr) return false;
  std::memcpy(&address, found->ai_addr, sizeof address);
  address.sin_port = htons(port);
  ::freeaddrinfo(found);
  return true;
}

}  // namespace

OpenStatus UdpBus::open(const char* host, std::uint16_t local_port, std::uint16_t remote_port) noexcept {
  close();
  OpenStatus status;
  const auto fail = [&](int error, const char* format, auto... values) {
    status.error_number = error == 0 ? EINVAL : error;
    std::snprintf(status.message.data(), status.message.size(), format, values...);
    close();
    return status;
  };
  sockaddr_in local{};
  sockaddr_in remote{};
  if (!resolve(host, local_port, local) || !resolve(host, remote_port, remote))
    return fail(EADDRNOTAVAIL, "host \"%s\" of the CAN tunnel cannot be resolved: give an IPv4 address or a known name, such as 127.0.0.1",
                host);
  socket_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (socket_ < 0) return fail(errno, "no UDP socket: %s", std::strerror(errno));
  if (::bind(socket_, reinterpret_cast<const sockaddr*>(&local), sizeof local) != 0) {
    const int error = errno;
    if (error == EADDRINUSE)
      return fail(error, "UDP port %u on %s is taken: end the program that holds it (ss -ulpn), or choose another port in the rig file",
                  unsigned{local_port}, host);
    if (error == EADDRNOTAVAIL) return fail(error, "%s is not an address of this machine: correct the host in the rig file", host);
    return fail(error, "UDP port %u on %s cannot be used: %s", unsigned{local_port}, host, std::strerror(error));
  }
  // A connected socket accepts datagrams of its peer alone.
  if (::connect(socket_, reinterpret_cast<const sockaddr*>(&remote), sizeof remote) != 0)
    return fail(errno, "UDP port %u on %s cannot be reached: %s", unsigned{remote_port}, host, std::strerror(errno));
  writer_.clear();
  sequence_known_ = false;
  return status;
}

void UdpBus::close() noexcept {
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
  reader_ = {};
}

bool UdpBus::send(const CanFrame& frame, std::int64_t now_ns) noexcept {
  if (socket_ < 0 || frame.length > 8) {
    ++counters_.send_dropped;
    return false;
  }
  if (writer_.append(frame)) return true;
  flush(now_ns);
  return writer_.append(frame);
}

void UdpBus::flush(std::int64_t) noexcept {
  if (writer_.count() == 0) return;
  const std::uint64_t frames = writer_.count();
  const auto datagram = writer_.finish(sequence_++);
  ssize_t done = ::send(socket_, datagram.data(), datagram.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  // The kernel reports that an earlier datagram found nobody on the first call after it; this one has not been tried yet.
  if (done < 0 && errno == ECONNREFUSED) done = ::send(socket_, datagram.data(), datagram.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  if (done == static_cast<ssize_t>(datagram.size())) {
    counters_.sent += frames;
  } else {
    counters_.send_dropped += frames;
    counters_.last_error_number = errno;
  }
  writer_.clear();
}

bool UdpBus::receive(CanFrame& frame, std::int64_t now_ns) noexcept {
  constexpr int attempts = 64;  // a flood of useless datagrams must not hold the caller
  for (int i = 0; i < attempts; ++i) {
    if (reader_.next(frame)) {
      frame.stamp_ns = now_ns;
      count_received(counters_, frame);
      return true;
    }
    if (socket_ < 0) return false;
    const ssize_t size = ::recv(socket_, datagram_.data(), datagram_.size(), MSG_DONTWAIT | MSG_TRUNC);
    if (size < 0) {
      if (errno == EAGAIN || errno == EWOULDBLOCK) return false;
      counters_.last_error_number = errno;  // ECONNREFUSED: the peer is not there yet
      continue;
    }
    const auto bytes = static_cast<std::size_t>(size);
    if (bytes > datagram_.size() || !reader_.open(std::span{datagram_}.first(bytes))) {
      ++counters_.malformed;
      continue;
    }
    counters_.unsupported += reader_.unsupported();
    if (sequence_known_) counters_.lost_datagrams += static_cast<std::uint8_t>(reader_.sequence() - expected_sequence_);
    expected_sequence_ = static_cast<std::uint8_t>(reader_.sequence() + 1);
    sequence_known_ = true;
  }
  return false;
}

}  // namespace trocar::hal
