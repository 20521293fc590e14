// The link over real sockets: UDP always, vcan0 and vcan1 where the kernel has them. Time stays a number; sockets on one machine
// deliver at once.
#include <gtest/gtest.h>

#include <cstdio>

#include "bare_socket.hpp"
#include "socket_link.hpp"

namespace trocar::hal {
namespace {

rig::BusEndpoint udp_endpoint() {
  rig::BusEndpoint endpoint;
  std::snprintf(endpoint.host.data(), endpoint.host.size(), "127.0.0.1");
  endpoint.rig_port = free_port();
  endpoint.plant_port = free_port();
  return endpoint;
}

TEST_F(SocketLinkTest, EnablesFourDrivesOverUdp) {
  open(udp_endpoint(), udp_endpoint());
  run_to_enabled();
}

}  // namespace
}  // namespace trocar::hal
