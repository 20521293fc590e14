// One axis of a haptic device held by a hand, under the firmware's haptic chain: continuous mechanics, sampled control.
//   M x'' + b x' + friction = f_h + u,   f_h = -m_h x'' + b_h (r' - x') + k_h (r - x) + f_0
// Signs: f_h force of the hand on the mechanism, u force of the motors on it, both in N along +x. Symplectic Euler in substeps
// (energy of a spring and mass is kept), Coulomb friction by impulse, so that it sticks. The controller sees an encoder, its
// velocity observer and f_h behind a critically damped second-order lag; its commands act `delay_ticks` later.
#pragma once

#include <array>
#include <functional>

#include "firmware/control/haptic.hpp"
#include "firmware/control/hysteresis.hpp"
#include "firmware/control/velocity_observer.hpp"

namespace trocar::reference {

struct Hand {
  double mass_kg{};
  double damping_n_s_m{};
  double stiffness_n_m{};
};

// The haptic rig's: moving mass, friction of four joints of 1.5 mN m at about 0.1 m.
struct AxisPlant {
  double mass_kg{0.32};
  double viscous_n_s_m{0.008};
  double coulomb_n{0.03};
  double encoder_step_m{};  // 0: exact
  bool hysteresis{true};
  double velocity_bandwidth_rad_s{300};  // as the controller's
  double force_bandwidth_rad_s{390};     // of the force observer
  std::size_t delay_ticks{1};            // as the drive bus has it
  double tick_hz{1000};
  int substeps{20};
};

// Force of the slave on its environment at a position and a velocity.
using Environment = std::function<double(double x_m, double v_m_s)>;

class HapticAxis {
 public:
  struct State {  // of everything but the firmware's own
    double x{}, v{};
    double held{};                      // encoder position behind the hysteresis
    double hand_force{};                // true, mean over the last substep
    double force_seen{}, force_rate{};  // lag
    std::array<double, control::most_delay_ticks + 1> under_way{};
    control::VelocityObserverState velocity{};
  };

  HapticAxis(const AxisPlant& plant, const Hand& hand, const control::HapticConfig& law, Environment environment)
      : plant_(plant), hand_(hand), law_(law), environment_(std::move(environment)) {}

  void enter(control::Display display, double u = 0.0);
  void change(control::Display display);

  // One tick: control with what is measured now, then mechanics until the next one. r, r': where the hand wants to be; f_0 its push.
  void tick(double r_m, double r_dot_m_s, double push_n);

  [[nodiscard]] double command_n() const { return u_; }  // of the last tick, as it left the controller
  [[nodiscard]] double environment_n() const { return f_e_; }

  State state{};
  control::HapticState haptic{};

 private:
  [[nodiscard]] double encoder() const;
  [[nodiscard]] control::DeviceState measured();

  AxisPlant plant_;
  Hand hand_;
  control::HapticConfig law_;
  Environment environment_;
  double u_{}, f_e_{};
};

}  // namespace trocar::reference
