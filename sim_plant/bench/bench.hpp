// Controller and plant in lock-step on a virtual clock, in one process: the real controller, the real bus protocol with its bit
// times, the simulated machine. Faster than real time, and the same bits every time.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "common/rig/rig.hpp"
#include "firmware/controller/controller.hpp"
#include "firmware/virtual_needle/virtual_needle.hpp"
#include "hal/can/memory_bus.hpp"
#include "hal/rig_link.hpp"
#include "sim_plant/faults/faults.hpp"
#include "sim_plant/hand/hand.hpp"
#include "sim_plant/wired/wired_plant.hpp"

namespace trocar::sim_plant {

class Bench {
 public:
  // scene: the tissue in front of the machine, if any. needle: what the controller shows in Haptic; must outlive the bench, as the hand
  // must.
  Bench(const rig::Rig& rig, const PlantConfig& plant, const std::optional<scene::Scene>& scene, std::uint64_t seed,
        virtual_needle::VirtualNeedle* needle = nullptr);

  // From now on this hand holds the handle; nullptr: nobody.
  void give_to(Hand* hand) noexcept { plant_.give_to(hand); }
  // What goes wrong, and when (bench time).
  [[nodiscard]] Faults& faults() noexcept { return faults_; }
  // Drives get every command a tick later than they should.
  void delay_commands(bool late) noexcept { late_ = late; }

  // One controller period. Afterwards sample() is the tick's, and mail() has what the controller said.
  void tick() noexcept;

  [[nodiscard]] controller::Mailboxes& mail() noexcept { return *mail_; }
  [[nodiscard]] controller::Controller& controller() noexcept { return controller_; }
  [[nodiscard]] const Sample& sample() noexcept { return controller_.sample(); }
  [[nodiscard]] WiredPlant& plant() noexcept { return plant_; }
  [[nodiscard]] std::int64_t now_ns() const noexcept { return now_ns_; }
  [[nodiscard]] hal::RigLink<hal::MemoryPort>& link() noexcept { return link_; }

 private:
  void step_plant(std::int64_t now_ns) noexcept;
  template <class Take, class Give>
  void exchange(Wire wire, hal::MemoryPort& port, std::int64_t now_ns, Take&& take, Give&& give) noexcept;
  void afflict(std::int64_t now_ns) noexcept;

  rig::Rig rig_;
  std::unique_ptr<controller::Mailboxes> mail_;
  hal::MemoryBus drives_bus_, sensor_bus_;
  hal::RigLink<hal::MemoryPort> link_;
  controller::Controller controller_;
  WiredPlant plant_;
  Faults faults_;
  bool late_{false};
  hal::LinkCommand held_{};
  std::int64_t now_ns_{};
};

}  // namespace trocar::sim_plant
