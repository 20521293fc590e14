#include "sim_plant/nodes/sdo_server.hpp"

#include <algorithm>

namespace trocar::sim_plant {

using hal::CanFrame;
using hal::canopen::Object;
using hal::canopen::SdoAbort;
namespace co = hal::canopen;

SdoServer::Outcome SdoServer::receive(const CanFrame& request, ObjectDictionary& objects, std::int64_t now_ns) noexcept {
  if (request.length != 8) return {};
  heard_ns_ = now_ns;
  const Object named{hal::load<std::uint16_t>(request, 1), request.data[3], 0};
  switch (request.data[0] >> 5) {  // client command specifier
    case 0:
      return download_segment(request, objects);
    case 1:
      return initiate_download(request, named, objects);
    case 2:
      return initiate_upload(named, objects);
    case 3:
      return upload_segment(request);
    case 4:
      open_ = Open::Nothing;
      return {};
    default:  // 5, 6: block transfers
      return abort(named, SdoAbort::UnknownCommand);
  }
}

std::optional<CanFrame> SdoServer::advance(std::int64_t now_ns) noexcept {
  if (open_ == Open::Nothing || now_ns - heard_ns_ < silence_ns) return std::nullopt;
  return abort(object_, SdoAbort::Timeout).answer;
}

SdoServer::Outcome SdoServer::abort(Object object, SdoAbort code) noexcept {
  open_ = Open::Nothing;
  ++aborts_;
  return {co::sdo_abort(co::cob_sdo_response(node_), object, static_cast<std::uint32_t>(code)), std::nullopt};
}

SdoServer::Outcome SdoServer::initiate_upload(Object object, const ObjectDictionary& objects) noexcept {
  open_ = Open::Nothing;
  if (const auto refusal = objects.read(object, value_)) return abort(object, *refusal);
  object_ = object;
  if (value_.bytes >= 1 && value_.bytes <= 4) {
    object.bytes = static_cast<std::uint8_t>(value_.bytes);
    std::uint32_t number = 0;
    for (std::size_t i = 0; i < value_.bytes; ++i) number |= std::uint32_t{value_.byte[i]} << (8 * i);
    return {co::sdo_upload_answer(node_, object, number), std::nullopt};
  }
  open_ = Open::Upload;
  toggle_ = 0;
  sent_ = 0;
  return {co::sdo_segmented_upload_answer(node_, object, static_cast<std::uint32_t>(value_.bytes)), std::nullopt};
}

SdoServer::Outcome SdoServer::upload_segment(const CanFrame& request) noexcept {
  if (open_ != Open::Upload) return abort({}, SdoAbort::UnknownCommand);
  if ((request.data[0] & co::sdo_toggle) != toggle_) return abort(object_, SdoAbort::ToggleBit);
  const std::size_t bytes = std::min(co::sdo_segment_bytes, value_.bytes - sent_);
  const auto part = value_.all().subspan(sent_, bytes);
  sent_ += bytes;
  const bool last = sent_ == value_.bytes;
  const CanFrame answer = co::sdo_segment(co::cob_sdo_response(node_), toggle_, part, last);
  toggle_ ^= co::sdo_toggle;
  if (last) open_ = Open::Nothing;
  return {answer, std::nullopt};
}

SdoServer::Outcome SdoServer::initiate_download(const CanFrame& request, Object object, ObjectDictionary& objects) noexcept {
  open_ = Open::Nothing;
  const std::uint8_t command = request.data[0];
  const bool is_stated = (command & 1) != 0;
  if ((command & 2) != 0) {
    // Without a stated size, the object's own: the client has filled four bytes and leaves it to the server how many count.
    const std::size_t bytes = is_stated ? 4u - ((command >> 2) & 3u) : std::min<std::size_t>(objects.bytes(object), 4);
    return finish_download(object, std::span{request.data}.subspan(4, bytes), objects, co::sdo_download_answer(node_, object));
  }
  stated_bytes_ = is_stated ? std::optional<std::size_t>{hal::load<std::uint32_t>(request, 4)} : std::nullopt;
  if (const auto refusal = objects.accepts(object, stated_bytes_)) return abort(object, *refusal);
  open_ = Open::Download;
  object_ = object;
  toggle_ = 0;
  value_.bytes = 0;
  return {co::sdo_download_answer(node_, object), std::nullopt};
}

SdoServer::Outcome SdoServer::download_segment(const CanFrame& request, ObjectDictionary& objects) noexcept {
  if (open_ != Open::Download) return abort({}, SdoAbort::UnknownCommand);
  const std::uint8_t command = request.data[0];
  if ((command & co::sdo_toggle) != toggle_) return abort(object_, SdoAbort::ToggleBit);
  const std::size_t bytes = co::sdo_bytes_of_segment(request);
  const std::size_t most = stated_bytes_ ? *stated_bytes_ : value_.byte.size();
  if (value_.bytes + bytes > most) return abort(object_, SdoAbort::TooLong);
  std::copy_n(request.data.begin() + 1, bytes, value_.byte.begin() + static_cast<std::ptrdiff_t>(value_.bytes));
  value_.bytes += bytes;
  const CanFrame done = co::sdo_segment_command(co::cob_sdo_response(node_), static_cast<std::uint8_t>(0x20 | toggle_));
  toggle_ ^= co::sdo_toggle;
  if ((command & 1) == 0) return {done, std::nullopt};
  if (stated_bytes_ && value_.bytes < *stated_bytes_) return abort(object_, SdoAbort::TooShort);
  return finish_download(object_, value_.all(), objects, done);
}

SdoServer::Outcome SdoServer::finish_download(Object object, std::span<const std::uint8_t> value, ObjectDictionary& objects,
                                              const CanFrame& done) noexcept {
  open_ = Open::Nothing;
  if (const auto refusal = objects.write(object, value)) return abort(object, *refusal);
  return {done, object};
}

}  // namespace trocar::sim_plant
