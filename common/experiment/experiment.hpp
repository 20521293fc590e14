// An experiment as plain data, and the steps that carry it out. The sequencer is a state machine without clock, bus or network: samples and
// replies in, commands out. The host runs it over DDS, the lock-step bench in the controller's own process.
// Two kinds: the rig inserts a needle, or a hand feels a virtual one, shown by one display after the other. Who holds the handle is nothing
// to the sequencer: a person, or the simulated one of a hand file, who knows nothing of the sequencer either.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/core/contracts.hpp"
#include "common/rig/rig.hpp"

namespace trocar::experiment {

// Home unless the rig is homed, tare, arm; then for each speed, side by side: approach, tare, (touch), insert, dwell, withdraw; disarm.
struct InsertionCourse {
  std::vector<double> speeds_m_s;  // one insertion each
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

// Home unless the rig is homed, tare, arm; take_s for the hand to take the handle; then each display for display_s; disarm.
struct HapticCourse {
  std::vector<Display> displays;
  double display_s{};  // what a person has to feel each
  double take_s{};
};

struct Experiment {
  std::string name;
  std::string rig, scene, plant;  // names in share, or paths
  std::string hand;               // of the simulated rig in a haptic experiment, name or path; else empty
  std::variant<InsertionCourse, HapticCourse> course;
  [[nodiscard]] bool haptic() const noexcept { return std::holds_alternative<HapticCourse>(course); }
};

// Where the tissue is, real or virtual, in the rig frame: the needle (length_m, along +y) enters through the face y = surface_y_m.
struct Placement {
  double surface_y_m{};
  double centre_x_m{};
  double needle_length_m{};
};

enum class PhaseKind : std::uint8_t { Prepare, Air, Touch, Insert, Dwell, Withdraw, Haptic };
[[nodiscard]] const char* to_string(PhaseKind kind) noexcept;
[[nodiscard]] std::optional<PhaseKind> phase_kind(const std::string& name);
// As files and command lines write them: four_channel, impedance, admittance.
[[nodiscard]] const char* to_string(Display display) noexcept;
[[nodiscard]] std::optional<Display> display_of(const std::string& name);

struct Phase {
  std::string name;
  PhaseKind kind{};
  double speed_m_s{};
  std::string gain_set;
  std::uint64_t first_tick{};
  std::uint64_t last_tick{};
  Display display{};  // of a Haptic phase
};

// Throws std::invalid_argument with a sentence for a person when a pose of the experiment lies outside of the rig's workspace, or the rig
// has not what the experiment needs.
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
  [[nodiscard]] double tip_depth_m(const Sample& sample) const noexcept;    // of the virtual tip in Haptic
  [[nodiscard]] double axial_force_n(const Sample& sample) const noexcept;  // of the base, or the virtual base, along the needle
  [[nodiscard]] const std::vector<Phase>& phases() const noexcept { return phases_; }
  [[nodiscard]] const std::vector<std::string>& notes() const noexcept { return notes_; }

 private:
  struct Step {
    Phase phase;
    Command command;
    double wait_s{};  // after the command, or instead of a KeepAlive
    double expected_s{};
    bool may_stop_early{};
    bool must_stop_early{};
  };
  void add(PhaseKind kind, std::string name, CommandKind command, double expected_s);
  void add_move(PhaseKind kind, std::string name, double x_m, double tip_depth_m, double speed_m_s, double stop_force_n = 0.0);
  void add_wait(PhaseKind kind, std::string name, double seconds);
  void add_insertion(const InsertionCourse& course, const std::string& name, double x_m, double speed_m_s);
  void add_course(const InsertionCourse& course);
  void add_course(const HapticCourse& course);
  void fail(std::string why);
  void begin_wait();
  void advance();

  Placement placement_;
  const rig::Rig& rig_;
  std::uint64_t session_;
  std::vector<Step> steps_;
  std::size_t step_{};
  bool sent_{};
  bool waiting_{};
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
