// What is replayed: for each kind of case how it begins, what one vector of it asks, and what it answers. The PC's generator runs the same
// code to make the vectors, so a difference is one of compiler, C library and processor.
#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <span>

#include "common/insertion/insertion.hpp"
#include "common/needle/beam.hpp"
#include "firmware/controller/controller.hpp"
#include "tests/targets/fields.hpp"
#include "tests/targets/golden.hpp"

namespace trocar::targets {

using Scalar = decltype(needle::Pose::x_m);  // double, or float where the sources are compiled so

// Numbers that have unit and scale in common, as a vector's components; an error is measured against the largest one in the case.
struct Quantity {
  const char* name;
  std::size_t size;
};

inline constexpr std::size_t most_values = 64;
inline constexpr std::size_t most_decisions = 16;
inline constexpr std::size_t most_quantities = 11;
// A moment is compared as a force at the needle's end: it is the difference of forces on such levers.
inline constexpr Scalar lever_m = static_cast<Scalar>(0.1);

struct Answer {
  std::array<double, most_values> value{};
  std::array<std::int64_t, most_decisions> decision{};  // modes, states, counts
  std::size_t values{};
  std::size_t decisions{};
  std::uint64_t cost{};  // of the computation alone, in units of `now`

  template <class... T>
  void values_of(const T&... more) {
    (add(more), ...);
  }
  void wrench_of(Scalar fx_n, Scalar fy_n, Scalar moment_nm) { values_of(fx_n, fy_n, moment_nm / lever_m); }
  void decide(std::int64_t what) { decision[decisions++] = what; }

 private:
  void add(Scalar x) { value[values++] = static_cast<double>(x); }
  template <class T, std::size_t n>
  void add(const std::array<T, n>& all) {
    for (const T& x : all) add(x);
  }
};

// Counts instructions where the platform can, else 0.
using Now = std::uint64_t (*)();

// One at a time; static, because there is no allocator where this runs.
struct Memory {
  alignas(64) std::array<std::byte, sizeof(insertion::Insertion)> insertion;
  alignas(64) std::array<std::byte, sizeof(virtual_needle::VirtualNeedle)> needle;
  alignas(64) std::array<std::byte, sizeof(controller::Controller)> controller;
  alignas(64) std::array<std::byte, sizeof(controller::Mailboxes)> mail;
  rig::Rig rig;
  hal::Feedback feedback;
  model::Image image;
  contact::Law law;
};
static_assert(sizeof(needle::Beam) <= sizeof(insertion::Insertion));

// What was there before needs no destruction: nothing in it owns anything.
template <class T, class... Arguments>
T& begin(std::span<std::byte> place, Arguments&&... arguments) {
  return *std::construct_at(reinterpret_cast<T*>(place.data()), std::forward<Arguments>(arguments)...);
}

// The controller's tick on what the machine said. With a needle, the model of Haptic mode runs in it.
class TickCase {
 public:
  static constexpr std::array<Quantity, 11> quantities{{{"joint torque", 4},
                                                        {"position", 2},
                                                        {"angle", 1},
                                                        {"velocity", 2},
                                                        {"angular velocity", 1},
                                                        {"set point", 2},
                                                        {"set point's angle", 1},
                                                        {"wrench asked for", 3},
                                                        {"hand's wrench", 3},
                                                        {"virtual needle's wrench", 3},
                                                        {"display's energy", 1}}};

  void open(Reader& in, Memory& memory, const model::Image& image) {
    fields(in, memory.rig);
    auto& insertion = begin<insertion::Insertion>(memory.insertion);
    auto& needle = begin<virtual_needle::VirtualNeedle>(memory.needle, insertion, control::FadeConfig{memory.rig.haptic.fade_s});
    needle.offer(&image);
    mail_ = &begin<controller::Mailboxes>(memory.mail);
    controller_ = &begin<controller::Controller>(memory.controller, memory.rig, *mail_, true, &needle);
    feedback_ = &memory.feedback;
  }

  void step(Reader& in, Answer& out, Now now) {
    std::int64_t now_ns{};
    std::uint64_t session{};
    std::uint32_t commands{};
    in(now_ns), fields(in, *feedback_), in(session), in(commands);
    for (std::uint32_t i = 0; i < commands && in.ok(); ++i) {
      Command command;
      fields(in, command);
      mail_->commands.push(command);
    }
    if (session != 0) mail_->commands.push({.session = session, .kind = CommandKind::KeepAlive});
    const std::uint64_t begin = now();
    const hal::LinkCommand& command = controller_->tick({now_ns, 0, feedback_});
    out.cost = now() - begin;
    Reply reply;
    while (mail_->replies.pop(reply)) last_reply_ = reply;
    Event event;
    while (mail_->events.pop(event)) last_event_ = event;
    const Sample& s = controller_->sample();
    out.values_of(command.joint_torque_nm, s.pose, s.velocity, s.setpoint_pose);
    for (const auto* wrench : {&s.wrench_command, &s.handle_wrench, &s.virtual_wrench})
      out.wrench_of((*wrench)[0], (*wrench)[1], (*wrench)[2]);
    out.values_of(s.display_energy_j);
    for (const std::int64_t what :
         {static_cast<std::int64_t>(command.request), static_cast<std::int64_t>(s.mode), static_cast<std::int64_t>(s.fault),
          static_cast<std::int64_t>(s.moving), static_cast<std::int64_t>(last_reply_.id), static_cast<std::int64_t>(last_reply_.code),
          static_cast<std::int64_t>(last_event_.kind), static_cast<std::int64_t>(s.virtual_contacts),
          static_cast<std::int64_t>(s.virtual_status)})
      out.decide(what);
  }

 private:
  controller::Controller* controller_{};
  controller::Mailboxes* mail_{};
  hal::Feedback* feedback_{};
  Reply last_reply_{};
  Event last_event_{};
};

// A needle, rigid or bending, on its way through the tissue of the image.
class InsertionCase {
 public:
  static constexpr std::size_t contacts = 10;  // that are looked at
  static constexpr std::array<Quantity, 5> quantities{
      {{"base wrench", 3}, {"tip", 2}, {"tip angle", 1}, {"path", 1}, {"contact force", 2 * contacts}}};

  void open(Reader& in, Memory& memory, const model::Image& image) {
    memory.image = image;
    memory.law = *image.law;
    memory.image.law = &memory.law;
    in(memory.law.method);
    fields(in, memory.image.needle);
    insertion_ = &begin<insertion::Insertion>(memory.insertion);
    insertion_->open(memory.image);
  }

  void step(Reader& in, Answer& out, Now now) {
    needle::Pose pose;
    Scalar dt_s{};
    fields(in, pose), in(dt_s);
    const std::uint64_t begin = now();
    const insertion::Result result = insertion_->step(pose, dt_s);
    out.cost = now() - begin;
    out.wrench_of(result.base.fx_n, result.base.fy_n, result.base.tau_nm);
    out.values_of(result.tip.x_m, result.tip.y_m, result.tip.theta_rad, result.path_m);
    std::array<Scalar, contacts> axial_n{}, lateral_n{};
    std::int64_t states = 0;
    for (std::size_t i = 0; i < std::min(insertion_->contacts(), contacts); ++i) {
      const insertion::Insertion::ContactReport report = insertion_->contact(i);
      axial_n[i] = report.axial_n;
      lateral_n[i] = report.lateral_n;
      states = 4 * states + static_cast<std::int64_t>(report.state);
    }
    out.values_of(axial_n, lateral_n);
    out.decide(static_cast<std::int64_t>(result.status));
    out.decide(static_cast<std::int64_t>(result.contacts));
    out.decide(states);
  }

 private:
  insertion::Insertion* insertion_{};
};

// Equilibria of the beam by itself under forces along the shaft, and its flexibility there.
class BeamCase {
 public:
  static constexpr std::size_t loads = 8;
  static constexpr std::array<Quantity, 5> quantities{
      {{"tip", 2}, {"tip angle", 1}, {"position", 2 * loads}, {"base wrench", 3}, {"flexibility", 4 * loads}}};

  void open(Reader& in, Memory& memory, const model::Image&) {
    needle::Properties properties;
    in(properties.length_m), in(properties.bending_nm2), in(properties.axial_n), in(properties.curvature_per_m), in(properties.elements);
    beam_ = &begin<needle::Beam>(memory.insertion);
    static_cast<void>(beam_->open(properties));
  }

  void step(Reader& in, Answer& out, Now now) {
    needle::Pose base;
    fields(in, base);
    std::array<needle::Load, loads> load{};
    for (needle::Load& l : load) in(l.arclength_m), in(l.force_n), in(l.moment_nm);
    const std::uint64_t begin = now();
    const needle::Result result = beam_->solve(base, load);
    const needle::Factor factor = beam_->linearise();
    out.cost = now() - begin;
    const needle::Station tip = beam_->tip();
    out.values_of(tip.position_m, tip.theta_rad);
    for (std::size_t i = 0; i < loads; ++i) out.values_of(beam_->position_m(i));
    const needle::Wrench reaction = beam_->reaction();
    out.wrench_of(reaction.fx_n, reaction.fy_n, reaction.tau_nm);
    for (std::size_t i = 0; i < loads; ++i) out.values_of(beam_->compliance(i, loads - 1));
    out.decide(static_cast<std::int64_t>(result.status));
    out.decide(static_cast<std::int64_t>(factor.status));
    out.decide(factor.negative_pivots);
  }

 private:
  needle::Beam* beam_{};
};

enum class Kind : std::int64_t { End, Tick, Insertion, Beam };

// Calls use(case) with a fresh case of that kind; false when there is none such.
template <class Use>
bool with_case(Kind kind, Use&& use) {
  switch (kind) {
    case Kind::Tick: {
      TickCase fresh;
      use(fresh);
      return true;
    }
    case Kind::Insertion: {
      InsertionCase fresh;
      use(fresh);
      return true;
    }
    case Kind::Beam: {
      BeamCase fresh;
      use(fresh);
      return true;
    }
    case Kind::End:
      break;
  }
  return false;
}

}  // namespace trocar::targets
