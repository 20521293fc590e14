// The fields of what goes into a case, in the order of the stream: the same function writes and reads, in float64 and in float32.
#pragma once

#include "common/core/contracts.hpp"
#include "common/model/image.hpp"
#include "common/needle/beam.hpp"
#include "common/rig/rig.hpp"
#include "hal/rig_link.hpp"

namespace trocar::targets {

// A field that is added to one of these has to be named below.
#if defined(__x86_64__) && !defined(TROCAR_FLOAT32)
static_assert(sizeof(rig::Rig) == 1632 && sizeof(hal::Feedback) == 176 && sizeof(Command) == 64 && sizeof(contact::Law) == 1976 &&
              sizeof(model::Needle) == 64);
#endif

template <class Archive>
void fields(Archive& a, mechanism::FiveBarModel& f) {
  for (auto* links : {&f.proximal, &f.distal})
    for (mechanism::Link& link : *links) a(link.length_m), a(link.mass_kg), a(link.com_m), a(link.inertia_kg_m2);
  a(f.base_m), a(f.end_point_mass_kg), a(f.reflected_inertia_kg_m2);
}

template <class Archive>
void fields(Archive& a, rig::Planar& p) {
  a(p.translation), a(p.rotation);
}
template <class Archive>
void fields(Archive& a, rig::Coupling& c) {
  fields(a, c.damping), fields(a, c.stiffness);
}

template <class Archive>
void fields(Archive& a, rig::Haptic& h) {
  a(h.present), a(h.fade_s), a(h.observer), a(h.observer_bandwidth_rad_s), a(h.observer_count_force_n);
  for (rig::Planar* p : {&h.desired_mass, &h.desired_damping, &h.desired_stiffness, &h.needle_mass, &h.needle_damping}) fields(a, *p);
  fields(a, h.master), fields(a, h.slave);
  a(h.adaptive_per_force_s_m), a(h.adaptive_per_moment_s_rad);
  fields(a, h.adaptive_least), fields(a, h.tracking);
  a(h.guard_credit_j), a(h.guard_softest_n_m), a(h.guard_bound_j), a(h.guard_damping_n_s_m);
}

// Without name, endpoints of the buses and DDS: the controller asks for none of them.
template <class Archive>
void fields(Archive& a, rig::Rig& r) {
  a(r.kind);
  for (mechanism::FiveBarModel& linkage : r.twin.linkage) fields(a, linkage);
  a(r.twin.coupling_m), a(r.twin.handle_m), a(r.twin.handle_mass_kg), a(r.twin.handle_com_m), a(r.twin.handle_inertia_kg_m2);
  rig::Actuation& u = r.actuation;
  a(u.torque_constant_nm_per_a), a(u.continuous_current_a), a(u.peak_current_a), a(u.rotor_inertia_kg_m2), a(u.gear_ratio);
  a(u.gear_efficiency), a(u.encoder_counts_per_turn), a(u.friction_coulomb_nm), a(u.friction_viscous_nm_s);
  a(r.homing_pose);
  for (rig::GainSet& g : r.gain_set) {
    for (rig::AxisGains* axis : {&g.translation, &g.rotation}) a(axis->proportional), a(axis->integral), a(axis->derivative);
    a(g.feed_forward);
  }
  a(r.gain_sets);
  rig::Limits& l = r.limits;
  a(l.torque_slew_nm_per_s), a(l.speed_m_s), a(l.angular_speed_rad_s), a(l.acceleration_m_s2), a(l.angular_acceleration_rad_s2);
  a(l.jerk_m_s3), a(l.angular_jerk_rad_s3), a(l.command_force_n), a(l.command_moment_nm), a(l.workspace_x_m), a(l.workspace_y_m);
  a(l.singularity), a(l.residual_m), a(l.torque_error_nm), a(l.torque_error_ticks), a(l.tracking_m), a(l.tracking_rad);
  a(l.fault_speed_m_s), a(l.fault_angular_speed_rad_s), a(l.fault_force_n), a(l.fault_moment_nm);
  rig::Timing& t = r.timing;
  a(t.tick_hz), a(t.feedback_deadline_us), a(t.missed_feedback_ticks), a(t.missed_sensor_ticks), a(t.host_timeout_ms), a(t.late_tick_us);
  a(t.late_tick_best_effort_us), a(t.heartbeat_ms), a(t.heartbeat_timeout_ms);
  a(r.sensor.counts_per_n), a(r.sensor.counts_per_nm), a(r.sensor.angle_rad);
  fields(a, r.haptic);
}

template <class Archive>
void fields(Archive& a, hal::Feedback& f) {
  a(f.state);
  for (hal::DriveFeedback& d : f.drive) {
    a(d.position_counts), a(d.joint_torque_nm), a(d.statusword);
    a(d.fresh), a(d.enabled), a(d.faulted), a(d.heartbeat_ok), a(d.emcy_code);
  }
  a(f.drives), a(f.sensor.force_torque), a(f.sensor.status), a(f.sensor.fresh), a(f.sensor.saturated), a(f.complete), a(f.bus_off);
}

template <class Archive>
void fields(Archive& a, Command& c) {
  a(c.session), a(c.id), a(c.kind), a(c.gain_set), a(c.display), a(c.target_pose), a(c.speed_m_s), a(c.angular_speed_rad_s);
  a(c.stop_force_n);
}

template <class Archive>
void fields(Archive& a, needle::Pose& p) {
  a(p.x_m), a(p.y_m), a(p.theta_rad);
}

template <class Archive>
void fields(Archive& a, model::Needle& n) {
  a(n.length_m), a(n.radius_m), a(n.elements), a(n.bending_nm2), a(n.axial_n), a(n.curvature_per_m), a(n.face_rad), a(n.tip_lateral);
}

template <class Archive>
void fields(Archive& a, contact::Law& l) {
  a(l.method), a(l.shaft_n_per_m), a(l.tip_n_per_m), a(l.tip_zone_m), a(l.spacing_m);
  a(l.velocity.rows), a(l.velocity.speed_m_s), a(l.velocity.shaft_n_per_m), a(l.velocity.tip_n_per_m);
  a(l.explicit_count), a(l.explicit_point_m), a(l.explicit_slip_force_n);
}

// A whole image for builds that cannot read the PC's, whose structs hold float64: numbers, then the lists as they stand, in the reader's
// own types. Integrals are the same in both.
template <class Archive>
void fields(Archive& a, model::Image& image, contact::Law& law) {
  model::Tissue& t = image.tissue;
  a(t.model), a(t.integration), a(t.thickness_m), a(t.edge_length_m);
  a(t.buckets.origin_m), a(t.buckets.size_m), a(t.buckets.count);
  fields(a, law);
  fields(a, image.needle);
  a.view(t.node_m), a.view(t.node_flags), a.view(t.cell), a.view(t.ring_begin), a.view(t.ring_cell), a.view(t.material);
  a.view(t.buckets.begin), a.view(t.buckets.cell), a.view(t.compliance32);
}

}  // namespace trocar::targets
