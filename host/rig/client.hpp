// The host's end of the rig's topics: sends commands, keeps the armed session alive, hands out what arrives.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/core/contracts.hpp"

namespace trocar::host {

struct RigStatus {
  std::string rig;
  Mode mode{};
  Fault fault{};
  bool homed{}, tared{}, real_time{};
  std::uint64_t session{};
  std::uint64_t tick{}, ticks_late{}, ticks_without_feedback{}, commands_lost{};
  std::string gain_set;
  std::string text;
  double drives_bus_percent{}, sensor_bus_percent{};  // measured load
  LoopCounters loop{};
  std::string machine;  // kernel and core of the loop, what of the real-time set-up is missing
};

struct RigReply {
  Reply reply;
  std::string text;
};

struct RigEvent {
  Event event;
  std::string text;
};

class RigClient {
 public:
  explicit RigClient(std::uint32_t domain);
  ~RigClient();

  [[nodiscard]] std::uint64_t session() const noexcept { return session_; }

  // Waits until a rig answers on the domain; throws config::UserError with the remedy when none does, or when it speaks another protocol.
  RigStatus wait_for_rig(double timeout_s);

  void send(const Command& command, const std::string& gain_set = {});  // session and id as given
  // Sends with this client's session and a new id and waits for the last word (not Accepted). Keeps the session alive meanwhile.
  RigReply ask(CommandKind kind, double timeout_s, const std::string& gain_set = {});
  RigReply ask(Command command, double timeout_s, const std::string& gain_set = {});  // session and id are set here
  void keep_alive();                                                                  // at most every 10 ms; call it often while armed

  struct Handlers {
    std::function<void(const Sample&)> sample{};
    std::function<void(const RigReply&)> reply{};
    std::function<void(const RigEvent&)> event{};
    std::function<void(const RigStatus&)> status{};
  };
  // Waits up to timeout_s for something to arrive, then hands out all that is there.
  void poll(double timeout_s, const Handlers& handlers);

 private:
  struct Entities;
  std::uint64_t session_;
  std::uint32_t next_id_{1'000'000};
  std::int64_t last_keep_alive_ns_{};
  std::unique_ptr<Entities> entities_;
};

}  // namespace trocar::host
