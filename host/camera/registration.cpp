#include "host/camera/registration.hpp"

#include <fmt/format.h>
#include <Eigen/Dense>
#include <unsupported/Eigen/NonLinearOptimization>
#include <unsupported/Eigen/NumericalDiff>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace trocar::camera {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double least_spread_m = 0.005;  // of the tool across the line that fits its path best: less is a line
constexpr double least_turn_rad = 0.05;   // less does not tell a mark's place in the tool from the camera's
constexpr double far_off = 5.0;           // robust standard deviations
constexpr std::size_t least_sightings = 12;

// Cubic between two poses, with their velocities.
std::optional<Vector3d> tool_at(const std::vector<ToolPose>& poses, double t_s) {
  const auto after = std::ranges::upper_bound(poses, t_s, {}, &ToolPose::t_s);
  if (after == poses.begin()) return std::nullopt;
  const ToolPose& a = *(after - 1);
  if (after == poses.end()) {
    if (t_s > a.t_s) return std::nullopt;
    return Vector3d(a.pose[0], a.pose[1], a.pose[2]);
  }
  const double h = after->t_s - a.t_s;
  if (h > longest_gap_s) return std::nullopt;
  const double s = (t_s - a.t_s) / h;
  Vector3d out;
  for (std::size_t k = 0; k < 3; ++k)
    out[static_cast<Eigen::Index>(k)] = (1 + 2 * s) * (1 - s) * (1 - s) * a.pose[k] + s * (1 - s) * (1 - s) * h * a.velocity[k] +
                                        s * s * (3 - 2 * s) * after->pose[k] - s * s * (1 - s) * h * after->velocity[k];
  return out;
}

Matrix3d matrix_of(const std::array<double, 3>& rotation) {
  const Vector3d r(rotation[0], rotation[1], rotation[2]);
  const double angle = r.norm();
  if (angle < 1e-12) return Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, r / angle).toRotationMatrix();
}

std::array<double, 3> rotation_of(const Matrix3d& matrix) {
  const Eigen::AngleAxisd aa(matrix);
  const Vector3d r = aa.angle() * aa.axis();
  return {r[0], r[1], r[2]};
}

struct Start {
  Matrix3d rotation = Matrix3d::Identity();
  Vector3d translation = Vector3d::Zero();
  std::array<double, 2> offset{};
};

// Rays and tool poses of one mark.
struct Pairs {
  std::vector<Vector3d> tool{};
  std::vector<optics::Ray> ray{};
};

// All columns are taken about their mean and by their spread: the sine of an angle near pi / 2 hardly differs from the constant.
Start linear_start(const Pairs& pairs, const std::array<double, 2>* known) {
  const std::size_t n = pairs.tool.size();
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  std::vector<Eigen::Vector2d> point;
  for (const Vector3d& tool : pairs.tool) {
    Eigen::Vector2d p(tool[0], tool[1]);
    if (known != nullptr)
      p += Eigen::Vector2d(std::cos(tool[2]) * (*known)[0] - std::sin(tool[2]) * (*known)[1],
                           std::sin(tool[2]) * (*known)[0] + std::cos(tool[2]) * (*known)[1]);
    point.push_back(p);
    mean += p / static_cast<double>(n);
  }
  double spread = 0.0;
  for (const auto& p : point) spread = std::max(spread, (p - mean).norm());
  const Eigen::Index unknowns = known != nullptr ? 3 : 5;
  Eigen::Array2d turn_mean = Eigen::Array2d::Zero(), turn_spread = Eigen::Array2d::Zero();
  const auto turn = [](const Vector3d& tool) { return Eigen::Array2d(std::cos(tool[2]), std::sin(tool[2])); };
  for (const Vector3d& tool : pairs.tool) turn_mean += turn(tool) / static_cast<double>(n);
  for (const Vector3d& tool : pairs.tool) turn_spread = turn_spread.max((turn(tool) - turn_mean).abs());
  MatrixXd system(2 * static_cast<Eigen::Index>(n), 3 * unknowns);
  for (std::size_t i = 0; i < n; ++i) {
    VectorXd w(unknowns);
    w.head<3>() << (point[i] - mean) / spread, 1.0;
    if (known == nullptr) w.tail<2>() = (turn(pairs.tool[i]) - turn_mean) / turn_spread;
    const auto row = 2 * static_cast<Eigen::Index>(i);
    system.row(row) << w.transpose(), Eigen::RowVectorXd::Zero(unknowns), -pairs.ray[i].x * w.transpose();
    system.row(row + 1) << Eigen::RowVectorXd::Zero(unknowns), w.transpose(), -pairs.ray[i].y * w.transpose();
  }
  const MatrixXd triangle = system.householderQr().matrixQR().topRows(3 * unknowns).triangularView<Eigen::Upper>();
  const Eigen::JacobiSVD<MatrixXd> least(triangle, Eigen::ComputeThinV);
  MatrixXd m(3, unknowns);
  for (Eigen::Index k = 0; k < 3; ++k) m.row(k) = least.matrixV().col(3 * unknowns - 1).segment(k * unknowns, unknowns).transpose();
  const auto column = [&m](Eigen::Index k) { return Vector3d(m(0, k), m(1, k), m(2, k)); };
  Vector3d h1 = column(0) / spread, h2 = column(1) / spread, middle = column(2);  // middle: where the mean of the points is seen
  const double scale = std::copysign(0.5 * (h1.norm() + h2.norm()), middle[2]);
  Start start;
  if (known == nullptr) {
    // columns 3 and 4: o1 h1 + o2 h2 and o1 h2 - o2 h1
    MatrixXd a(6, 2);
    VectorXd b(6);
    for (Eigen::Index k = 0; k < 3; ++k) {
      a.row(k) << h1[k], h2[k];
      a.row(k + 3) << h2[k], -h1[k];
      b[k] = m(k, 3) / turn_spread[0];
      b[k + 3] = m(k, 4) / turn_spread[1];
    }
    const Eigen::Vector2d o = a.colPivHouseholderQr().solve(b);
    start.offset = {o[0], o[1]};
    middle -= column(3) * turn_mean[0] / turn_spread[0] + column(4) * turn_mean[1] / turn_spread[1];
  } else {
    start.offset = *known;
  }
  h1 /= scale;
  h2 /= scale;
  start.translation = middle / scale - h1 * mean[0] - h2 * mean[1];
  Matrix3d r;
  r << h1, h2, h1.cross(h2);
  const Eigen::JacobiSVD<Matrix3d> svd(r, Eigen::ComputeFullU | Eigen::ComputeFullV);
  start.rotation = svd.matrixU() * Eigen::Vector3d(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant()).asDiagonal() *
                   svd.matrixV().transpose();
  return start;
}

// Parameters: rotation about the camera's axes beyond the start's, translation, then delay and offsets where they are sought.
struct Problem {
  const optics::Lens& lens;
  const std::vector<Sighting>& sightings;
  const std::vector<ToolPose>& poses;
  std::size_t marks{};
  bool seek_delay{}, seek_offset{};
  Matrix3d rotation = Matrix3d::Identity();
  double delay_s{};
  std::vector<std::array<double, 2>> offset{};

  // what Eigen asks of a functor
  using Scalar = double;
  using InputType = VectorXd;
  using ValueType = VectorXd;
  using JacobianType = MatrixXd;
  enum { InputsAtCompileTime = Eigen::Dynamic, ValuesAtCompileTime = Eigen::Dynamic };
  [[nodiscard]] int inputs() const { return 6 + (seek_delay ? 1 : 0) + (seek_offset ? static_cast<int>(2 * marks) : 0); }
  [[nodiscard]] int values() const { return static_cast<int>(2 * sightings.size()); }

  [[nodiscard]] optics::Pose pose_of(const VectorXd& x) const {
    return {rotation_of(matrix_of({x[0], x[1], x[2]}) * rotation), {x[3], x[4], x[5]}};
  }
  [[nodiscard]] double delay_of(const VectorXd& x) const { return seek_delay ? x[6] : delay_s; }
  [[nodiscard]] std::array<double, 2> offset_of(const VectorXd& x, std::size_t mark) const {
    if (!seek_offset) return offset[mark];
    const auto at = static_cast<Eigen::Index>((seek_delay ? 7 : 6) + 2 * mark);
    return {x[at], x[at + 1]};
  }

  int operator()(const VectorXd& x, VectorXd& residual) const {
    constexpr double unseen_px = 1e4;  // out of sight: bad, and finite
    const optics::PlaneView view(lens, pose_of(x));
    for (std::size_t i = 0; i < sightings.size(); ++i) {
      const auto tool = tool_at(poses, sightings[i].t_s + delay_of(x));
      const auto o = offset_of(x, sightings[i].mark);
      const auto at = 2 * static_cast<Eigen::Index>(i);
      residual[at] = residual[at + 1] = unseen_px;
      if (!tool) continue;
      const double c = std::cos((*tool)[2]), s = std::sin((*tool)[2]);
      const auto pixel = view.project({(*tool)[0] + c * o[0] - s * o[1], (*tool)[1] + s * o[0] + c * o[1]});
      if (!pixel) continue;
      residual[at] = pixel->u_px - sightings[i].pixel.u_px;
      residual[at + 1] = pixel->v_px - sightings[i].pixel.v_px;
    }
    return 0;
  }
};

struct Solution {
  VectorXd x{};
  VectorXd residual{};
};

Solution solve(const Problem& problem, VectorXd x) {
  Eigen::NumericalDiff<Problem, Eigen::Central> functor(problem);
  Eigen::LevenbergMarquardt<Eigen::NumericalDiff<Problem, Eigen::Central>> lm(functor);
  lm.parameters.maxfev = 100 * (2 * problem.inputs() + 1);  // the differences are counted too
  lm.parameters.xtol = lm.parameters.ftol = 1e-13;
  lm.minimize(x);
  Solution out{x, VectorXd(problem.values())};
  (void)problem(x, out.residual);
  return out;
}

double rms_of(const VectorXd& residual) { return std::sqrt(2.0 * residual.squaredNorm() / static_cast<double>(residual.size())); }

// Of the tool's path across its best line.
double spread_across(const std::vector<Sighting>& sightings, const std::vector<ToolPose>& poses, double delay_s) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  std::vector<Eigen::Vector2d> points;
  for (const Sighting& s : sightings)
    if (const auto tool = tool_at(poses, s.t_s + delay_s)) points.emplace_back((*tool)[0], (*tool)[1]);
  for (const auto& p : points) mean += p / static_cast<double>(points.size());
  Eigen::Matrix2d c = Eigen::Matrix2d::Zero();
  for (const auto& p : points) c += (p - mean) * (p - mean).transpose() / static_cast<double>(points.size());
  return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(c).eigenvalues()[0]));
}

double turn_of(const std::vector<Sighting>& sightings, const std::vector<ToolPose>& poses, double delay_s) {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const Sighting& s : sightings)
    if (const auto tool = tool_at(poses, s.t_s + delay_s)) {
      least = std::min(least, (*tool)[2]);
      most = std::max(most, (*tool)[2]);
    }
  return most - least;
}

// Five robust standard deviations away; of a normal distribution the median of |r| is 0.6745 of them.
std::vector<bool> outliers_of(const VectorXd& residual) {
  std::vector<double> size;
  for (Eigen::Index i = 0; i < residual.size(); ++i) size.push_back(std::abs(residual[i]));
  const auto middle = size.begin() + static_cast<std::ptrdiff_t>(size.size() / 2);
  std::ranges::nth_element(size, middle);
  const double limit = far_off * std::max(*middle / 0.6745, 1e-6);
  std::vector<bool> out;
  for (Eigen::Index i = 0; i < residual.size(); i += 2) out.push_back(std::max(std::abs(residual[i]), std::abs(residual[i + 1])) > limit);
  return out;
}

}  // namespace

Registration register_camera(const optics::Lens& lens, const std::vector<Sighting>& sightings, const std::vector<ToolPose>& poses,
                             const RegistrationOptions& options) {
  Registration out;
  std::size_t marks = 0;
  std::vector<Sighting> used;
  // Where the delay is sought the sightings at both ends may fall off the samples on the way: what is near them is left out from the start.
  const double room = options.known_delay ? 0.0 : longest_gap_s;
  for (const Sighting& s : sightings) {
    marks = std::max(marks, s.mark + 1);
    const double t = s.t_s + options.delay_s;
    if (tool_at(poses, t) && tool_at(poses, t - room) && tool_at(poses, t + room))
      used.push_back(s);
    else
      ++out.outside;
  }
  if (used.size() < least_sightings)
    throw Undetermined(
        fmt::format("{} sightings lie within the rig's samples, and {} outside; at least {} are needed: are both of one run, on "
                    "one clock? (--delay-s shifts the frames)",
                    used.size(), out.outside, least_sightings));
  if (const double across = spread_across(used, poses, options.delay_s); across < least_spread_m)
    throw Undetermined(
        fmt::format("the tool moved along a line (it strays from one by {:.2f} mm RMS, {:g} mm are needed): move it in both directions",
                    1e3 * across, 1e3 * least_spread_m));
  const bool known_offset = !options.offset_m.empty();
  if (known_offset && options.offset_m.size() < marks)
    throw Undetermined(fmt::format("{} marks, but the places of {}", marks, options.offset_m.size()));
  if (const double turn = turn_of(used, poses, options.delay_s); !known_offset && turn < least_turn_rad)
    throw Undetermined(
        fmt::format("the tool turned by {:.3f} rad, too little to tell where the mark sits on it ({:g} are needed): turn it during "
                    "the motion, or give --mark-m",
                    turn, least_turn_rad));

  const optics::Rectifier rectifier(lens);
  std::vector<Pairs> pairs(marks);
  for (const Sighting& s : used) {
    const optics::Mapped mapped = rectifier.newton(s.pixel);
    if (mapped.status != optics::Status::Ok) continue;
    pairs[s.mark].tool.push_back(*tool_at(poses, s.t_s + options.delay_s));
    pairs[s.mark].ray.push_back(optics::to_ray(lens, mapped.pixel));
  }
  std::vector<Start> starts;
  std::size_t best = 0;
  for (std::size_t k = 0; k < marks; ++k) {
    if (pairs[k].tool.size() < least_sightings)
      throw Undetermined(fmt::format("mark {} was seen {} times; at least {} are needed: leave it out, or follow it longer", k,
                                     pairs[k].tool.size(), least_sightings));
    starts.push_back(linear_start(pairs[k], known_offset ? &options.offset_m[k] : nullptr));
    if (pairs[k].tool.size() > pairs[best].tool.size()) best = k;
  }

  Problem problem{lens, used, poses, marks, !options.known_delay, !known_offset, starts[best].rotation, options.delay_s, options.offset_m};
  const auto begin = [&](const Vector3d& translation) {
    VectorXd x = VectorXd::Zero(problem.inputs());
    x.segment<3>(3) = translation;
    if (problem.seek_delay) x[6] = options.delay_s;
    for (std::size_t k = 0; problem.seek_offset && k < marks; ++k)
      x.segment<2>(static_cast<Eigen::Index>((problem.seek_delay ? 7 : 6) + 2 * k)) << starts[k].offset[0], starts[k].offset[1];
    return x;
  };
  Solution solution = solve(problem, begin(starts[best].translation));
  const Vector3d t = solution.x.segment<3>(3);
  const Matrix3d flip = Matrix3d::Identity() - 2.0 * t.normalized() * t.normalized().transpose();
  const Matrix3d other_rotation = flip * matrix_of(problem.pose_of(solution.x).rotation_rad) * Vector3d(1, 1, -1).asDiagonal();
  Problem mirrored = problem;
  mirrored.rotation = other_rotation;
  VectorXd from = solution.x;
  from.head<3>().setZero();
  const Solution other = solve(mirrored, from);
  out.mirrored_rms_px = rms_of(other.residual);
  if (other.residual.squaredNorm() < solution.residual.squaredNorm()) {
    out.mirrored_rms_px = rms_of(solution.residual);
    problem.rotation = other_rotation;
    solution = other;
  }

  // Both bounded: every round leaves out at least one.
  std::vector<Sighting> kept = used;
  for (int round = 0; round < 10; ++round) {
    const std::vector<bool> bad = outliers_of(solution.residual);
    std::vector<Sighting> good;
    for (std::size_t i = 0; i < kept.size(); ++i)
      if (!bad[i]) good.push_back(kept[i]);
    if (good.size() == kept.size()) break;
    if (good.size() < least_sightings) throw Undetermined("most sightings do not fit any pose: are marks and samples of one run?");
    out.outliers += kept.size() - good.size();
    kept = std::move(good);
    Problem rest{lens, kept, poses, marks, problem.seek_delay, problem.seek_offset, problem.rotation, problem.delay_s, problem.offset};
    solution = solve(rest, solution.x);
  }

  const Problem last{lens, kept, poses, marks, problem.seek_delay, problem.seek_offset, problem.rotation, problem.delay_s, problem.offset};
  MatrixXd jacobian(last.values(), last.inputs());
  const Eigen::NumericalDiff<Problem, Eigen::Central> derivative(last);
  derivative.df(solution.x, jacobian);
  const MatrixXd normal = jacobian.transpose() * jacobian;
  const VectorXd unit = normal.diagonal().cwiseSqrt().cwiseInverse();
  const MatrixXd scaled = unit.asDiagonal() * normal * unit.asDiagonal();
  const double variance = solution.residual.squaredNorm() / std::max(1.0, static_cast<double>(last.values() - last.inputs()));
  const MatrixXd covariance = variance * (unit.asDiagonal() * scaled.inverse() * unit.asDiagonal());
  const auto deviation = [&](Eigen::Index k) { return std::sqrt(std::max(0.0, covariance(k, k))); };

  out.pose = last.pose_of(solution.x);
  out.pose_deviation = {{deviation(0), deviation(1), deviation(2)}, {deviation(3), deviation(4), deviation(5)}};
  out.delay_s = last.delay_of(solution.x);
  if (last.seek_delay) out.delay_deviation_s = deviation(6);
  for (std::size_t k = 0; k < marks; ++k) {
    out.offset_m.push_back(last.offset_of(solution.x, k));
    const auto at = static_cast<Eigen::Index>((last.seek_delay ? 7 : 6) + 2 * k);
    out.offset_deviation_m.push_back(last.seek_offset ? std::array<double, 2>{deviation(at), deviation(at + 1)} : std::array<double, 2>{});
  }
  out.rms_px = rms_of(solution.residual);
  out.used = kept.size();
  return out;
}

Placement place(const optics::Pose& rig, const optics::Pose& phantom) {
  const Matrix3d r = matrix_of(rig.rotation_rad), p = matrix_of(phantom.rotation_rad);
  const Vector3d rt(rig.translation_m[0], rig.translation_m[1], rig.translation_m[2]);
  const Vector3d pt(phantom.translation_m[0], phantom.translation_m[1], phantom.translation_m[2]);
  const Matrix3d rotation = r.transpose() * p;
  const Vector3d origin = r.transpose() * (pt - rt);
  return {origin[0], origin[1], origin[2], std::atan2(rotation(1, 0), rotation(0, 0)), std::acos(std::clamp(rotation(2, 2), -1.0, 1.0))};
}

}  // namespace trocar::camera
