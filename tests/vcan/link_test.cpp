#include "socket_link.hpp"

namespace trocar::hal {
namespace {

rig::BusEndpoint can_endpoint(const char* interface) {
  rig::BusEndpoint endpoint;
  std::snprintf(endpoint.interface.data(), endpoint.interface.size(), "%s", interface);
  return endpoint;
}

TEST_F(SocketLinkTest, EnablesFourDrivesOverSocketCan) {
  open(can_endpoint("vcan0"), can_endpoint("vcan1"));
  run_to_enabled();
}

}  // namespace
}  // namespace trocar::hal
