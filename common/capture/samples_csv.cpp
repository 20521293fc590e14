#include "common/capture/samples_csv.hpp"

#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <utility>

namespace trocar::capture {

namespace {

constexpr std::size_t buffer_bytes = std::size_t{1} << 18;

template <class T>
void integer(std::string& out, T value) {
  char text[24];
  out.append(text, std::to_chars(text, text + sizeof text, value).ptr);
}

// As printf's %.17g and %.9g in the C locale, except that no NaN carries a sign.
template <class T>
void real(std::string& out, T value, int digits) {
  if (std::isnan(value)) {
    out += "nan";
    return;
  }
  char text[40];
  out.append(text, std::to_chars(text, text + sizeof text, value, std::chars_format::general, digits).ptr);
}

}  // namespace

std::string_view samples_csv_header() {
  return "tick,time_ns,mode,fault,moving,gain_set,command_id,"
         "position_0_counts,position_1_counts,position_2_counts,position_3_counts,"
         "joint_torque_command_0_nm,joint_torque_command_1_nm,joint_torque_command_2_nm,joint_torque_command_3_nm,"
         "joint_torque_measured_0_nm,joint_torque_measured_1_nm,joint_torque_measured_2_nm,joint_torque_measured_3_nm,"
         "x_m,y_m,theta_rad,vx_m_s,vy_m_s,omega_rad_s,"
         "setpoint_x_m,setpoint_y_m,setpoint_theta_rad,setpoint_vx_m_s,setpoint_vy_m_s,setpoint_omega_rad_s,"
         "command_fx_n,command_fy_n,command_tau_nm,base_fx_n,base_fy_n,base_tau_nm,"
         "residual_m,singularity,missed_feedback_ticks,wakeup_late_us,tick_us,"
         "handle_fx_n,handle_fy_n,handle_tau_nm,virtual_x_m,virtual_y_m,virtual_theta_rad,virtual_fx_n,virtual_fy_n,virtual_tau_nm,"
         "display_energy_j,virtual_contacts,virtual_status";
}

void append_samples_csv(std::string& out, const trocar::Sample& sample) {
  const auto comma = [&] { out += ','; };
  const auto reals = [&](const auto& values) {
    for (const double value : values) {
      comma();
      real(out, value, 17);
    }
  };
  integer(out, sample.tick);
  comma();
  integer(out, sample.time_ns);
  comma();
  out += to_string(sample.mode);
  comma();
  out += to_string(sample.fault);
  for (const std::uint32_t value : {std::uint32_t{sample.moving}, std::uint32_t{sample.gain_set}, sample.command_id}) {
    comma();
    integer(out, value);
  }
  for (const std::int32_t counts : sample.position_counts) {
    comma();
    integer(out, counts);
  }
  reals(sample.joint_torque_command_nm);
  reals(sample.joint_torque_measured_nm);
  reals(sample.pose);
  reals(sample.velocity);
  reals(sample.setpoint_pose);
  reals(sample.setpoint_velocity);
  reals(sample.wrench_command);
  reals(sample.base_wrench);
  reals(std::array{sample.residual_m, sample.singularity});
  comma();
  integer(out, sample.missed_feedback);
  for (const float value : {sample.wakeup_late_us, sample.tick_us}) {
    comma();
    real(out, value, 9);
  }
  reals(sample.handle_wrench);
  reals(sample.virtual_pose);
  reals(sample.virtual_wrench);
  reals(std::array{sample.display_energy_j});
  for (const std::uint32_t value : {sample.virtual_contacts, std::uint32_t{sample.virtual_status}}) {
    comma();
    integer(out, value);
  }
  out += '\n';
}

SamplesCsv::SamplesCsv(std::filesystem::path path)
    : path_(std::move(path)), temporary_(path_.string() + "." + std::to_string(::getpid()) + ".part") {
  file_ = std::fopen(temporary_.c_str(), "wbe");
  if (file_ == nullptr) fail(errno);
  std::setvbuf(file_, nullptr, _IONBF, 0);  // buffered here, so that errors surface in put()
  buffer_.reserve(buffer_bytes + 4096);
  buffer_ += samples_csv_header();
  buffer_ += '\n';
}

SamplesCsv::~SamplesCsv() {
  if (file_ == nullptr) return;
  std::fclose(file_);
  std::remove(temporary_.c_str());
}

void SamplesCsv::write(const trocar::Sample& sample) {
  ticks_.see(sample.tick);
  append_samples_csv(buffer_, sample);
  if (buffer_.size() >= buffer_bytes) put();
}

void SamplesCsv::finish() {
  put();
  if (std::fclose(std::exchange(file_, nullptr)) != 0) fail(errno);
  if (std::rename(temporary_.c_str(), path_.c_str()) != 0) fail(errno);
}

void SamplesCsv::put() {
  if (std::fwrite(buffer_.data(), 1, buffer_.size(), file_) != buffer_.size()) fail(errno);
  buffer_.clear();
}

void SamplesCsv::fail(int error) {
  if (file_ != nullptr) std::fclose(std::exchange(file_, nullptr));
  std::remove(temporary_.c_str());
  throw CaptureError("cannot write " + path_.string() + ": " + std::strerror(error) +
                     "; choose a folder that exists, that you may write to and that has space");
}

TickCounter write_samples_csv(const std::filesystem::path& path, std::span<const trocar::Sample> samples) {
  SamplesCsv csv(path);
  for (const trocar::Sample& sample : samples) csv.write(sample);
  csv.finish();
  return csv.ticks();
}

}  // namespace trocar::capture
