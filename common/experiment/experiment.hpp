// An insertion experiment as plain data, and the steps that carry it out. The sequencer is a state machine without clock, bus or
// network: samples and replies in, commands out. The host runs it over DDS, the lock-step bench in the controller's own process.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/core/contracts.hpp"
#include "common/rig/rig.hpp"

namespace trocar::experiment {

struct Experiment {
  std::string name;
  std::string rig, scene, plant;   // names in share, or paths
  std::vector<double> speeds_m_s;  // one insertion each, side by side
  double depth_m{};                // of the tip below the entry face
  double standoff_m{};             // tip in front of the entry face between insertions
  double lane_spacing_m{};         // between the insertions, across the needle
  double approach_speed_m_s{};     // in the air
  double touch_speed_m_s{};
  double touch_force_n{};  // base force that counts as contact
  double withdraw_speed_m_s{};
  double dwell_s{};     // at full depth
  bool thesis_check{};  // one more insertion with the gain set "thesis"
  double thesis_speed_m_s{};
};

// Where the tissue is, in the rig frame: the needle (length_m, along +y) enters through the face y = surface_y_m.
struct Placement {
  double surface_y_m{};
  double centre_x_m{};
  double needle_length_m{};
};

enum class PhaseKind : std::uint8_t { Prepare, Air, Touch, Insert, Dwell, Withdraw };
[[nodiscard]] const char* to_string(PhaseKind kind) noexcept;
[[nodiscard]] std::optional<PhaseKind> phase_kind(const std::string& name);

struct Phase {
  std::string name;
  PhaseKind kind{};
  double speed_m_s{};
  std::string gain_set;
  std::uint64_t first_tick{};
  std::uint64_t last_tick{};
};

// Throws std::invalid_argument with a sentence for a person when a pose of the experiment lies outside of the rig's workspace.
class Sequencer {
 public:
  Sequencer(const Experiment& experiment, const Placement& placement, const rig::Rig& rig, std::uint64_t session);

  void on_reply(const Reply& reply);
  void on_sample(const Sample& sample);
  // The next command to send, if it is time for one. Keep-alives are the sender's affair.
  [[nodiscard]] std::optional<Command> next();

  [[nodiscard]] bool finished() const noexcept { return step_ == steps_.size() || failed(); }
  [[nodiscard]] bool failed() const noexcept { return !failure_.empty(); }
  [[nodiscard]] const std::string& failure() const noexcept { return failure_; }  // what happened, for a person
  [[nodiscard]] double progress() const noexcept;                                 // 0 … 1 of the expected time
  [[nodiscard]] double expected_s() const noexcept { return expected_total_s_; }
  [[nodiscard]] const std::string& phase_name() const noexcept;
  [[nodiscard]] double tip_depth_m(const Sample& sample) const noexcept;
  [[nodiscard]] const std::vector<Phase>& phases() const noexcept { return phases_; }
  [[nodiscard]] const std::vector<std::string>& notes() const noexcept { return notes_; }

 private:
  struct Step {
    Phase phase;
    Command command;
    double wait_s{};  // instead of a command
    double expected_s{};
    bool may_stop_early{};
    bool must_stop_early{};
  };
  void add(PhaseKind kind, std::string name, CommandKind command, double expected_s);
  void add_move(PhaseKind kind, std::string name, double x_m, double tip_depth_m, double speed_m_s, double stop_force_n = 0.0);
  void add_wait(PhaseKind kind, std::string name, double seconds);
  void add_insertion(const std::string& name, double x_m, double speed_m_s);
  void fail(std::string why);
  void advance();

  Experiment experiment_;
  Placement placement_;
  const rig::Rig& rig_;
  std::uint64_t session_;
  std::vector<Step> steps_;
  std::size_t step_{};
  bool sent_{};
  std::uint64_t now_tick_{};
  std::int64_t now_ns_{};
  std::int64_t step_start_ns_{};
  std::int64_t ask_again_ns_{};  // 0: no refused command waits for another try
  double done_s_{};
  double expected_total_s_{};
  std::string planned_gains_;
  std::array<double, 2> planned_{};  // x_m, y_m at the end of the steps planned so far
  Mode mode_{};
  Sample last_{};
  bool seen_{};
  std::string failure_;
  std::vector<Phase> phases_;
  std::vector<std::string> notes_;
};

}  // namespace trocar::experiment
