#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <vector>

namespace trocar::hal {

// A bare socket of the test's own, on a port that the system chose.
struct BareSocket {
  BareSocket() : descriptor{::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0)} {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    ::bind(descriptor, reinterpret_cast<sockaddr*>(&address), sizeof address);
    socklen_t size = sizeof address;
    ::getsockname(descriptor, reinterpret_cast<sockaddr*>(&address), &size);
    port = ntohs(address.sin_port);
  }
  ~BareSocket() { release(); }
  void release() {
    if (descriptor >= 0) ::close(descriptor);
    descriptor = -1;
  }
  void send_to(std::uint16_t to, const std::vector<std::uint8_t>& bytes) const {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(to);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    ::sendto(descriptor, bytes.data(), bytes.size(), 0, reinterpret_cast<sockaddr*>(&address), sizeof address);
  }
  int descriptor;
  std::uint16_t port{};
};

inline std::uint16_t free_port() { return BareSocket{}.port; }

}  // namespace trocar::hal
