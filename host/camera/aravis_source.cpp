#include "host/camera/aravis_source.hpp"

#include <arv.h>
#include <fmt/format.h>

#include <atomic>
#include <cstring>
#include <utility>

#include "common/config/user_error.hpp"

namespace trocar::camera {
namespace {

constexpr std::uint64_t buffers = 8;
// A camera that sends nothing for so long and does not answer is gone; one that is merely not triggered answers.
constexpr std::chrono::milliseconds silence{1500};

// Whatever Aravis calls an error, in words.
class Error {
 public:
  ~Error() { clear(); }
  Error() = default;
  Error(const Error&) = delete;
  Error& operator=(const Error&) = delete;
  GError** operator&() {  // NOLINT(google-runtime-operator): GLib's way of handing an error out
    clear();
    return &error_;
  }
  explicit operator bool() const { return error_ != nullptr; }
  [[nodiscard]] std::string text() const { return error_ == nullptr ? "" : error_->message; }

 private:
  void clear() {
    if (error_ != nullptr) g_error_free(std::exchange(error_, nullptr));
  }
  GError* error_{};
};

struct Unref {
  void operator()(void* object) const {
    if (object != nullptr) g_object_unref(object);
  }
};

std::string names_of(const std::vector<FoundCamera>& cameras) {
  if (cameras.empty()) return "none is found here: check its power, cable and network (trocar camera list)";
  std::string text = "there are";
  for (const FoundCamera& c : cameras) text += fmt::format(" \"{}\"", c.id);
  return text;
}

class AravisSource : public Source {
 public:
  AravisSource(const std::string& name, const SourceOptions& options) {
    Error error;
    camera_.reset(arv_camera_new(name.empty() ? nullptr : name.c_str(), &error));
    if (camera_ == nullptr)
      throw config::UserError(fmt::format("aravis{}{}: no such camera can be opened ({}); {}", name.empty() ? "" : ":", name, error.text(),
                                          names_of(list_cameras())));
    const char* model = arv_camera_get_model_name(camera_.get(), nullptr);
    const char* id = arv_camera_get_device_id(camera_.get(), nullptr);
    what_ = fmt::format("camera {} ({})", id != nullptr ? id : name, model != nullptr ? model : "no model name");
    const auto refuse = [this](const std::string& why) { throw config::UserError(fmt::format("{}: {}", what_, why)); };
    take_format();
    arv_camera_set_acquisition_mode(camera_.get(), ARV_ACQUISITION_MODE_CONTINUOUS, nullptr);
    if (arv_camera_is_frame_rate_available(camera_.get(), nullptr)) {
      arv_camera_set_frame_rate(camera_.get(), options.rate_hz, &error);
      if (error)
        notices_.push_back(
            fmt::format("{}: takes no {:g} frames a second ({}); it goes on as it was", what_, options.rate_hz, error.text()));
    }
    if (options.exposure_s > 0.0) {
      arv_camera_set_exposure_time_auto(camera_.get(), ARV_AUTO_OFF, nullptr);
      arv_camera_set_exposure_time(camera_.get(), 1e6 * options.exposure_s, &error);
      if (error)
        refuse(fmt::format("takes no exposure of {:g} s ({}); leave it out, or give one that it can", options.exposure_s, error.text()));
    }
    stream_.reset(arv_camera_create_stream(camera_.get(), nullptr, nullptr, &error));
    if (stream_ == nullptr) refuse(fmt::format("gives no stream ({}); is another program using it?", error.text()));
    const guint payload = arv_camera_get_payload(camera_.get(), &error);
    if (error) refuse(fmt::format("does not say how large its frames are ({})", error.text()));
    for (std::uint64_t k = 0; k < buffers; ++k) arv_stream_push_buffer(stream_.get(), arv_buffer_new(payload, nullptr));
    g_signal_connect(arv_camera_get_device(camera_.get()), "control-lost", G_CALLBACK(on_lost), &lost_);
    arv_camera_start_acquisition(camera_.get(), &error);
    if (error) refuse(fmt::format("does not start ({})", error.text()));
    heard_ = std::chrono::steady_clock::now();
  }
  ~AravisSource() override {
    if (camera_ == nullptr) return;
    if (gone_) {  // to say goodbye to it takes Aravis a dozen seconds of waiting for answers; what it holds ends with the program
      (void)stream_.release();  // NOLINT(bugprone-unused-return-value): on purpose
      (void)camera_.release();  // NOLINT(bugprone-unused-return-value)
      return;
    }
    g_signal_handlers_disconnect_by_data(arv_camera_get_device(camera_.get()), &lost_);
    if (!lost_.load()) arv_camera_stop_acquisition(camera_.get(), nullptr);
  }
  AravisSource(const AravisSource&) = delete;
  AravisSource& operator=(const AravisSource&) = delete;

  Status next(optics::Frame& frame, std::chrono::milliseconds timeout) override {
    const auto end = std::chrono::steady_clock::now() + timeout;
    while (true) {
      const auto left =
          std::max<std::int64_t>(0, std::chrono::duration_cast<std::chrono::microseconds>(end - std::chrono::steady_clock::now()).count());
      // In short waits: the loss of the camera comes as a signal, in another thread.
      ArvBuffer* buffer = arv_stream_timeout_pop_buffer(stream_.get(), static_cast<guint64>(std::min<std::int64_t>(left, 50'000)));
      const auto now = std::chrono::steady_clock::now();
      if (buffer != nullptr) {
        heard_ = now;
        const bool good = take(buffer, frame);
        arv_stream_push_buffer(stream_.get(), buffer);
        if (good) return Status::Frame;
        continue;
      }
      if (lost_.load() || (now - heard_ > silence && !answers())) {
        if (!gone_)
          what_ += ": is gone (unplugged, switched off, or its network is down); plug it in and start again. What came before is whole";
        gone_ = true;
        return Status::Lost;
      }
      if (now >= end) return Status::Timeout;
    }
  }
  [[nodiscard]] SourceCounters counters() const override { return counters_; }
  [[nodiscard]] Clock clock() const override { return Clock::Camera; }
  [[nodiscard]] std::string what() const override { return what_; }
  std::vector<std::string> notices() override { return std::exchange(notices_, {}); }

 private:
  static void on_lost(ArvDevice*, std::atomic<bool>* lost) { lost->store(true); }

  void take_format() {
    Error error;
    const std::pair<ArvPixelFormat, optics::PixelFormat> known[] = {{ARV_PIXEL_FORMAT_MONO_8, optics::PixelFormat::Mono8},
                                                                    {ARV_PIXEL_FORMAT_BAYER_RG_8, optics::PixelFormat::BayerRG8},
                                                                    {ARV_PIXEL_FORMAT_RGB_8_PACKED, optics::PixelFormat::Rgb8}};
    const ArvPixelFormat now = arv_camera_get_pixel_format(camera_.get(), &error);
    for (const auto& [theirs, ours] : known) {
      if (!error && now == theirs) {
        format_ = ours;
        return;
      }
    }
    guint count = 0;
    gint64* offered = arv_camera_dup_available_pixel_formats(camera_.get(), &count, nullptr);
    bool found = false;
    for (const auto& [theirs, ours] : known) {
      for (guint k = 0; k < count && !found; ++k) {
        if (offered[k] != theirs) continue;
        arv_camera_set_pixel_format(camera_.get(), theirs, &error);
        found = !error;
        format_ = ours;
      }
    }
    g_free(offered);
    if (found) return;
    std::string names;
    const char** texts = arv_camera_dup_available_pixel_formats_as_strings(camera_.get(), &count, nullptr);
    for (guint k = 0; k < count; ++k) names += fmt::format("{}{}", k > 0 ? ", " : "", texts[k]);
    g_free(static_cast<gpointer>(texts));
    throw config::UserError(fmt::format("{}: has no Mono8, BayerRG8 or RGB8, which are known here, but {}; set it to one of them", what_,
                                        names.empty() ? "none that it names" : names));
  }

  bool take(ArvBuffer* buffer, optics::Frame& frame) {
    const std::uint64_t id = arv_buffer_get_frame_id(buffer);
    const bool good = arv_buffer_get_status(buffer) == ARV_BUFFER_STATUS_SUCCESS;
    // GigE Vision 1 counts from 1 to 65535 and over again.
    if (counters_.frames + counters_.lost > 0) {
      std::uint64_t step = id - id_;
      if (id < id_) step = id_ <= 0xFFFF ? (0xFFFF - id_) + id : 1;
      if (step > 1 && step < 0x8000) {
        counters_.lost += step - 1;
        notices_.push_back(fmt::format("{} frames before number {} are lost on their way", step - 1, number_ + step));
      }
      number_ += std::max<std::uint64_t>(1, step);
    }
    id_ = id;
    if (!good) {
      ++counters_.lost;
      notices_.push_back(
          fmt::format("frame {} is lost: it came damaged (status {})", number_, static_cast<int>(arv_buffer_get_status(buffer))));
      return false;
    }
    std::size_t size = 0;
    const void* data = arv_buffer_get_image_data(buffer, &size);
    frame.width_px = arv_buffer_get_image_width(buffer);
    frame.height_px = arv_buffer_get_image_height(buffer);
    frame.format = format_;
    const std::size_t wanted =
        static_cast<std::size_t>(frame.width_px) * static_cast<std::size_t>(frame.height_px) * optics::channels(format_);
    if (data == nullptr || size < wanted) {
      ++counters_.lost;
      notices_.push_back(fmt::format("frame {} is lost: it has {} bytes of {}", number_, size, wanted));
      return false;
    }
    frame.pixels.resize(wanted);
    std::memcpy(frame.pixels.data(), data, wanted);
    const std::uint64_t stamp = arv_buffer_get_timestamp(buffer);
    frame.number = number_;
    frame.arrived_ns = now_ns();
    frame.time_uncertainty_ns = 0;
    frame.time_ns = static_cast<std::int64_t>(stamp != 0 ? stamp : arv_buffer_get_system_timestamp(buffer));
    ++counters_.frames;
    return true;
  }

  [[nodiscard]] bool answers() {
    Error error;
    gint width = 0, height = 0;
    arv_camera_get_region(camera_.get(), nullptr, nullptr, &width, &height, &error);
    if (!error) heard_ = std::chrono::steady_clock::now();
    return !error;
  }

  std::unique_ptr<ArvCamera, Unref> camera_{};
  std::unique_ptr<ArvStream, Unref> stream_{};
  std::string what_{};
  optics::PixelFormat format_{};
  std::atomic<bool> lost_{};
  bool gone_{};
  std::chrono::steady_clock::time_point heard_{};
  std::uint64_t id_{}, number_{};
  SourceCounters counters_{};
  std::vector<std::string> notices_{};
};

}  // namespace

std::vector<FoundCamera> list_cameras() {
  arv_update_device_list();
  std::vector<FoundCamera> out;
  const auto text = [](const char* t) { return std::string(t != nullptr ? t : ""); };
  for (unsigned k = 0; k < arv_get_n_devices(); ++k)
    out.push_back({text(arv_get_device_id(k)), text(arv_get_device_vendor(k)), text(arv_get_device_model(k)),
                   text(arv_get_device_serial_nbr(k)), text(arv_get_device_address(k)), text(arv_get_device_protocol(k))});
  return out;
}

std::unique_ptr<Source> open_aravis(const std::string& name, const SourceOptions& options) {
  return std::make_unique<AravisSource>(name, options);
}

}  // namespace trocar::camera
