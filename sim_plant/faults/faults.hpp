// Troubles of the simulated rig, each for a span of time. Wires: the frames that the plant's nodes send, or those that reach them, whose
// identifier matches. Parts: one drive, the sensor, or the whole plant. Nothing here knows what the controller makes of it.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "common/core/capacities.hpp"
#include "hal/can/frame.hpp"

namespace trocar::sim_plant {

enum class Ailment : std::uint8_t {
  // frames
  Lost,
  Late,  // by `amount` seconds; only what the plant sends
  Twice,
  OutOfOrder,  // two after each other change places
  Shortened,   // by a byte
  Flipped,     // bit `amount` of the data, behind the checksum: a defective node, not the wire
  Babbled,     // a foreign node sends `amount` frames of the highest priority every millisecond
  BusOff,      // the rig's CAN controller reports that it is off the bus, once
  // parts; `drive` says which
  Emergency,      // an emergency message, once; the drive goes on
  DriveFault,     // the drive's own protection: code `amount`, once
  LeftOperation,  // back to pre-operational as if another master had asked, once
  PowerCut,       // gone and back, once
  EncoderStuck,
  EncoderJumped,  // by `amount` rad
  EncoderBackwards,
  MotorDead,
  MotorFull,  // peak torque whatever is commanded
  SensorSaturated,
  Frozen,  // the plant stands still: no physics, no node
};

enum class Wire : std::uint8_t { Drives, Sensor };
enum class Way : std::uint8_t { FromPlant, ToPlant };

struct Trouble {
  Ailment ailment{};
  Wire wire{};
  Way way{};
  std::uint32_t id{}, mask{};  // frames with (id & mask) == this id; mask 0: all
  std::size_t drive{};
  double amount{};
  std::int64_t from_ns{};
  std::int64_t to_ns = std::numeric_limits<std::int64_t>::max();
};

class Faults {
 public:
  void add(const Trouble& trouble) { troubles_.push_back({trouble, false, {}, false}); }
  void clear() {
    troubles_.clear();
    under_way_.clear();
  }
  [[nodiscard]] bool any() const noexcept { return !troubles_.empty(); }

  // What becomes of a frame: put(frame) for each that goes on now.
  template <class Put>
  void carry(Wire wire, Way way, const hal::CanFrame& frame, std::int64_t now_ns, Put&& put) {
    for (const hal::CanFrame& f : passed(wire, way, frame, now_ns)) put(f);
  }
  // Frames that were held back and are due, and what a babbling node sends.
  template <class Put>
  void release(Wire wire, std::int64_t now_ns, Put&& put) {
    for (const hal::CanFrame& f : due(wire, now_ns)) put(f);
  }

  // A trouble of a part that is on; nullptr when it is not.
  [[nodiscard]] const Trouble* on(Ailment ailment, std::size_t drive, std::int64_t now_ns) const noexcept;
  // The same for what happens once: true the first time.
  [[nodiscard]] const Trouble* once(Ailment ailment, std::size_t drive, std::int64_t now_ns) noexcept;

 private:
  struct Active {
    Trouble trouble{};
    bool done{};
    hal::CanFrame held{};  // OutOfOrder: the first of a pair
    bool holds{};
  };
  struct UnderWay {
    Wire wire{};
    hal::CanFrame frame{};
    std::int64_t due_ns{};
  };
  [[nodiscard]] std::vector<hal::CanFrame> passed(Wire wire, Way way, const hal::CanFrame& frame, std::int64_t now_ns);
  [[nodiscard]] std::vector<hal::CanFrame> due(Wire wire, std::int64_t now_ns);

  std::vector<Active> troubles_;
  std::vector<UnderWay> under_way_;
  std::int64_t babbled_to_ns_{};
};

}  // namespace trocar::sim_plant
