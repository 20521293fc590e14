#include "hal/can/socketcan_bus.hpp"

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <linux/net_tstamp.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>

namespace trocar::hal {
namespace {

static_assert(error_class_controller == CAN_ERR_CRTL && error_class_no_acknowledge == CAN_ERR_ACK &&
              error_class_bus_off == CAN_ERR_BUSOFF && error_class_restarted == CAN_ERR_RESTARTED);
static_assert(controller_overflow == (CAN_ERR_CRTL_RX_OVERFLOW | CAN_ERR_CRTL_TX_OVERFLOW) &&
              controller_warning == (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING) &&
              controller_passive == (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE) && controller_active == CAN_ERR_CRTL_ACTIVE);

using Stamps = std::array<timespec, 3>;  // struct scm_timestamping: the kernel's, an obsolete one, the hardware's

constexpr std::int64_t nanoseconds(const timespec& time) noexcept { return time.tv_sec * 1'000'000'000 + time.tv_nsec; }

}  // namespace

OpenStatus SocketCanBus::open(const char* interface, std::span<const std::uint32_t> ids) noexcept {
  close();
  overflowed_ = 0;
  next_ = filled_ = 0;
  hardware_clock_ = {};
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
  if (!ids.empty()) {
    std::array<can_filter, CAN_RAW_FILTER_MAX> filter;
    if (ids.size() > filter.size())
      return fail(EINVAL, "CAN interface %s: a socket takes at most %d identifiers", interface, CAN_RAW_FILTER_MAX);
    for (std::size_t i = 0; i < ids.size(); ++i) filter[i] = {ids[i], CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG};
    if (::setsockopt(socket_, SOL_CAN_RAW, CAN_RAW_FILTER, filter.data(), static_cast<socklen_t>(ids.size() * sizeof filter[0])) != 0)
      return fail(errno, "CAN interface %s does not filter: %s", interface, std::strerror(errno));
  }
  // None of these three is needed for the frames themselves: counting CAN FD frames and losses, and the time of reception, without
  // which frames carry the time of the read.
  ::setsockopt(socket_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
  ::setsockopt(socket_, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
  const int stamps =
      SOF_TIMESTAMPING_RX_HARDWARE | SOF_TIMESTAMPING_RAW_HARDWARE | SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE;
  ::setsockopt(socket_, SOL_SOCKET, SO_TIMESTAMPING, &stamps, sizeof stamps);
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
  if (next_ == filled_) {
    fill(now_ns);
    if (filled_ == 0) return false;
  }
  frame = received_[next_++];
  count_received(counters_, frame);
  return true;
}

// One call for many frames: a system call costs more than a frame.
void SocketCanBus::fill(std::int64_t now_ns) noexcept {
  struct Message {
    canfd_frame raw;  // its beginning is laid out as a classic frame
    iovec part;
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(Stamps)) + CMSG_SPACE(sizeof(std::uint32_t))> control;
  };
  std::array<Message, batch> message;
  std::array<mmsghdr, batch> header{};
  for (std::size_t i = 0; i < batch; ++i) {
    message[i].part = {&message[i].raw, sizeof message[i].raw};
    header[i].msg_hdr.msg_iov = &message[i].part;
    header[i].msg_hdr.msg_iovlen = 1;
    header[i].msg_hdr.msg_control = message[i].control.data();
    header[i].msg_hdr.msg_controllen = message[i].control.size();
  }
  next_ = filled_ = 0;
  const int count = ::recvmmsg(socket_, header.data(), batch, MSG_DONTWAIT, nullptr);
  if (count < 0) {
    if (errno != EAGAIN && errno != EWOULDBLOCK) counters_.last_error_number = errno;
    return;
  }
  timespec current{};
  ::clock_gettime(CLOCK_REALTIME, &current);
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    std::int64_t age_ns = 0;
    for (cmsghdr* note = CMSG_FIRSTHDR(&header[i].msg_hdr); note != nullptr; note = CMSG_NXTHDR(&header[i].msg_hdr, note)) {
      if (note->cmsg_level != SOL_SOCKET) continue;
      if (note->cmsg_type == SO_RXQ_OVFL) {
        std::uint32_t overflowed = 0;
        std::memcpy(&overflowed, CMSG_DATA(note), sizeof overflowed);
        counters_.receive_dropped += overflowed - overflowed_;
        overflowed_ = overflowed;
      } else if (note->cmsg_type == SCM_TIMESTAMPING) {
        Stamps stamp{};
        std::memcpy(&stamp, CMSG_DATA(note), sizeof stamp);
        const std::int64_t kernel_ns = nanoseconds(stamp[0]);
        const std::int64_t hardware_ns = nanoseconds(stamp[2]);
        age_ns = nanoseconds(current) - (hardware_ns == 0 ? kernel_ns : hardware_clock_.carry_over(hardware_ns, kernel_ns));
      }
    }
    if (header[i].msg_len != CAN_MTU) {
      ++counters_.unsupported;
      continue;
    }
    const canfd_frame& raw = message[i].raw;
    CanFrame& frame = received_[filled_++];
    frame = {};
    frame.extended = (raw.can_id & CAN_EFF_FLAG) != 0;
    frame.remote = (raw.can_id & CAN_RTR_FLAG) != 0;
    frame.error = (raw.can_id & CAN_ERR_FLAG) != 0;
    frame.id = raw.can_id & CAN_EFF_MASK;
    frame.length = raw.len <= 8 ? raw.len : std::uint8_t{8};
    std::memcpy(frame.data.data(), raw.data, frame.data.size());
    frame.stamp_ns = now_ns - age_ns;
  }
}

}  // namespace trocar::hal
