#include "hal/can/socketcan_bus.hpp"

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace trocar::hal {
static_assert(error_class_bus_off == CAN_ERR_BUSOFF);

OpenStatus SocketCanBus::open(const char* interface) noexcept {
  close();
  OpenStatus status;
  const auto fail = [&](int error, const char* format, auto... values) {
    status.error_number = error == 0 ? EINVAL : error;
    std::snprintf(status.message.data(), status.message.size(), format, values...);
    close();
    return status;
  };
  socket_ = ::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (socket_ < 0)
    return fail(errno, "this kernel has no CAN sockets (%s): load can_raw (modprobe can_raw), or use UDP buses in the rig file",
                std::strerror(errno));
  ifreq request{};
  if (std::strlen(interface) >= sizeof request.ifr_name)
    return fail(ENODEV, "\"%s\" is too long for the name of a CAN interface", interface);
  std::memcpy(request.ifr_name, interface, std::strlen(interface) + 1);
  if (::ioctl(socket_, SIOCGIFINDEX, &request) != 0)
    return fail(errno, "there is no CAN interface %s: see ip link, and correct the interface in the rig file", interface);
  const int index = request.ifr_ifindex;
  if (::ioctl(socket_, SIOCGIFFLAGS, &request) == 0 && (request.ifr_flags & IFF_UP) == 0)
    return fail(ENETDOWN, "CAN interface %s is down: ip link set %s up", interface, interface);

  const can_err_mask_t errors = CAN_ERR_MASK;
  const int on = 1;
  if (::setsockopt(socket_, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) != 0)
    return fail(errno, "CAN interface %s does not report errors: %s", interface, std::strerror(errno));
  ::setsockopt(socket_, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);  // without it, frames carry the time of the read
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = index;
  if (::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    return fail(errno, "CAN interface %s cannot be used: %s (is it a CAN interface?)", interface, std::strerror(errno));
  return status;
}

void SocketCanBus::close() noexcept {
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
}

bool SocketCanBus::send(const CanFrame& frame, std::int64_t) noexcept {
  can_frame raw{};
  raw.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0) | (frame.remote ? CAN_RTR_FLAG : 0);
  raw.can_dlc = frame.length;
  std::memcpy(raw.data, frame.data.data(), sizeof raw.data);
  if (socket_ < 0 || frame.length > 8 || frame.error || ::write(socket_, &raw, sizeof raw) != static_cast<ssize_t>(sizeof raw)) {
    ++counters_.send_dropped;
    counters_.last_error_number = errno;  // ENOBUFS: the interface's queue is full; ENETDOWN: it was taken down
    return false;
  }
  ++counters_.sent;
  return true;
}

bool SocketCanBus::receive(CanFrame& frame, std::int64_t now_ns) noexcept {
  if (socket_ < 0) return false;
  can_frame raw{};
  iovec part{&raw, sizeof raw};
  alignas(cmsghdr) char control[CMSG_SPACE(sizeof(timespec))];
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control;
  message.msg_controllen = sizeof control;
  if (::recvmsg(socket_, &message, MSG_DONTWAIT) != static_cast<ssize_t>(sizeof raw)) {
    if (errno != EAGAIN && errno != EWOULDBLOCK) counters_.last_error_number = errno;
    return false;
  }
  frame = {};
  frame.extended = (raw.can_id & CAN_EFF_FLAG) != 0;
  frame.remote = (raw.can_id & CAN_RTR_FLAG) != 0;
  frame.error = (raw.can_id & CAN_ERR_FLAG) != 0;
  frame.id = raw.can_id & CAN_EFF_MASK;
  frame.length = raw.can_dlc <= 8 ? raw.can_dlc : std::uint8_t{8};
  std::memcpy(frame.data.data(), raw.data, sizeof raw.data);
  frame.stamp_ns = now_ns;
  const cmsghdr* header = CMSG_FIRSTHDR(&message);
  if (header != nullptr && header->cmsg_level == SOL_SOCKET && header->cmsg_type == SCM_TIMESTAMPNS) {
    timespec received{}, current{};
    std::memcpy(&received, CMSG_DATA(header), sizeof received);
    ::clock_gettime(CLOCK_REALTIME, &current);
    frame.stamp_ns -= (current.tv_sec - received.tv_sec) * 1'000'000'000 + (current.tv_nsec - received.tv_nsec);
  }
  count_received(counters_, frame);
  return true;
}

}  // namespace trocar::hal
