// The SDO server of a simulated node (CiA 301, 7.2.4.3): expedited and segmented transfers, one at a time. Block transfers and unknown
// commands are aborted with 0504 0001h. A new request ends an open transfer; so does silence of its client.
#pragma once

#include <cstdint>
#include <optional>

#include "hal/can/frame.hpp"
#include "hal/canopen/sdo.hpp"
#include "sim_plant/nodes/object_dictionary.hpp"

namespace trocar::sim_plant {

class SdoServer {
 public:
  static constexpr std::int64_t silence_ns = 1'000'000'000;

  explicit SdoServer(std::uint8_t node) noexcept : node_{node} {}

  struct Outcome {
    std::optional<hal::CanFrame> answer;
    std::optional<hal::canopen::Object> written;  // its value is in the dictionary
  };
  // A frame to 600h + node.
  [[nodiscard]] Outcome receive(const hal::CanFrame& request, ObjectDictionary& objects, std::int64_t now_ns) noexcept;
  // The abort message for a client that fell silent in the middle of a transfer.
  [[nodiscard]] std::optional<hal::CanFrame> advance(std::int64_t now_ns) noexcept;
  void reset() noexcept { open_ = Open::Nothing; }
  [[nodiscard]] std::uint64_t aborts() const noexcept { return aborts_; }

 private:
  enum class Open : std::uint8_t { Nothing, Upload, Download };
  [[nodiscard]] Outcome initiate_upload(hal::canopen::Object object, const ObjectDictionary& objects) noexcept;
  [[nodiscard]] Outcome initiate_download(const hal::CanFrame& request, hal::canopen::Object object, ObjectDictionary& objects) noexcept;
  [[nodiscard]] Outcome upload_segment(const hal::CanFrame& request) noexcept;
  [[nodiscard]] Outcome download_segment(const hal::CanFrame& request, ObjectDictionary& objects) noexcept;
  [[nodiscard]] Outcome finish_download(hal::canopen::Object object, std::span<const std::uint8_t> value, ObjectDictionary& objects,
                                        const hal::CanFrame& done) noexcept;
  [[nodiscard]] Outcome abort(hal::canopen::Object object, hal::canopen::SdoAbort code) noexcept;

  std::uint8_t node_;
  Open open_{};
  hal::canopen::Object object_{};
  ObjectDictionary::Value value_{};
  std::size_t sent_{};
  std::optional<std::size_t> stated_bytes_;  // of a download
  std::uint8_t toggle_{};
  std::int64_t heard_ns_{};
  std::uint64_t aborts_{};
};

}  // namespace trocar::sim_plant
