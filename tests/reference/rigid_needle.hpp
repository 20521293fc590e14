// A straight rigid needle through marked tissue points: turns its pose into the gaps of box_qp.hpp and keeps each point's place on the
// shaft.
//   d_i = base + s_i t - X_i      X_i the tissue point at rest, s_i its arclength on the needle [m]
//   s_i <- s_i - ds_i             after a tick: the needle slipped forward by ds_i
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "tests/reference/box_qp.hpp"

namespace trocar::reference {

struct Pose {
  double x_m{}, y_m{}, theta_rad{};  // of the base; theta from base to tip
};

class RigidNeedle {
 public:
  // The point joins where the shaft comes closest to it; its lateral distance becomes part of the gap.
  void add(const std::array<double, 2>& point_m, const Pose& pose, double lower_n, double upper_n) {
    const double c = std::cos(pose.theta_rad), s = std::sin(pose.theta_rad);
    point_.push_back(point_m);
    arclength_m_.push_back(c * (point_m[0] - pose.x_m) + s * (point_m[1] - pose.y_m));
    target_.push_back({{c, s}, {}, lower_n, upper_n});
  }
  void pop() {
    point_.pop_back();
    arclength_m_.pop_back();
    target_.pop_back();
  }
  const std::vector<Contact>& move_to(const Pose& pose) {
    const double c = std::cos(pose.theta_rad), s = std::sin(pose.theta_rad);
    for (std::size_t i = 0; i < point_.size(); ++i) {
      target_[i].tangent = {c, s};
      target_[i].gap_m = {pose.x_m + arclength_m_[i] * c - point_[i][0], pose.y_m + arclength_m_[i] * s - point_[i][1]};
    }
    return target_;
  }
  void slipped(std::size_t i, double slip_m) { arclength_m_[i] -= slip_m; }
  [[nodiscard]] const std::vector<Contact>& target() const { return target_; }
  [[nodiscard]] std::size_t size() const { return point_.size(); }

 private:
  std::vector<std::array<double, 2>> point_{};
  std::vector<double> arclength_m_{};
  std::vector<Contact> target_{};
};

}  // namespace trocar::reference
