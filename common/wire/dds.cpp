#include "common/wire/dds.hpp"

#include <dlfcn.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "dds/ddsi/ddsi_serdata.h"
#include "dds/ddsrt/log.h"

namespace trocar::wire {

namespace {

// Multicast is off because a loopback interface has none; peers are then found by asking one port after the other, of which the default
// allows ten. The buffers hold a second of samples while a reader sleeps.
constexpr const char* loopback_configuration = R"(
  <General>
    <Interfaces><NetworkInterface name="lo"/></Interfaces>
    <AllowMulticast>false</AllowMulticast>
    <MaxMessageSize>65500B</MaxMessageSize>
  </General>
  <Discovery>
    <ParticipantIndex>auto</ParticipantIndex>
    <MaxAutoParticipantIndex>31</MaxAutoParticipantIndex>
    <Peers><Peer address="127.0.0.1"/></Peers>
  </Discovery>
  <Internal><SocketReceiveBufferSize min="default" max="16MB"/></Internal>
)";

[[noreturn]] void fail(const std::string& what, dds_return_t code, const std::string& remedy) {
  throw Error(what + ": " + dds_strretcode(code) + "; " + remedy);
}

const char* keys_folder() {
  const char* const folder = std::getenv("TROCAR_KEYS");
  return folder != nullptr && *folder != '\0' ? folder : nullptr;
}

void replace(std::string& text, std::string_view what, const std::string& by) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += by.size()) text.replace(at, what.size(), by);
}

// Cyclone's plugins lie beside its library, or in a folder that Debian names after the package.
std::filesystem::path plugins() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<void*>(&dds_create_participant), &info) == 0 || info.dli_fname == nullptr) return {};
  const std::filesystem::path beside = std::filesystem::canonical(info.dli_fname).parent_path();
  for (const auto& folder : {beside, beside / "libddsc0debian"})
    if (std::filesystem::exists(folder / "libdds_security_auth.so")) return folder;
  return {};
}

std::string configuration_of(const std::filesystem::path& keys) {
  const auto file = keys / "network.xml";
  std::ifstream in(file);
  std::string text{std::istreambuf_iterator<char>(in), {}};
  if (!in || text.empty())
    throw Error("TROCAR_KEYS: " + file.string() + " cannot be read; name a folder rig, host or observer that trocar keys made");
  const auto folder = plugins();
  if (folder.empty()) throw Error("TROCAR_KEYS: this Cyclone DDS has no security plugins; install Debian's libddsc0debian with them");
  replace(text, "@KEYS@", std::filesystem::canonical(keys).string());
  replace(text, "@PLUGINS@", folder.string());
  return text;
}

// A configuration can be given only while a domain is created, so the process's participants of one domain share the handle.
std::shared_ptr<Entity> configure(std::uint32_t domain) {
  if (reach() == Reach::Open) return nullptr;
  static std::mutex mutex;
  static std::map<std::uint32_t, std::weak_ptr<Entity>> known;
  const std::lock_guard lock(mutex);
  if (auto present = known[domain].lock()) return present;
  const std::string configuration = keys_folder() != nullptr ? configuration_of(keys_folder()) : loopback_configuration;
  const dds_entity_t handle = dds_create_domain(domain, configuration.c_str());
  if (handle == DDS_RETCODE_PRECONDITION_NOT_MET) return nullptr;  // made by somebody else in this process
  if (handle < 0) {
    if (keys_folder() != nullptr)
      fail("DDS domain " + std::to_string(domain) + " cannot be opened with the keys in " + keys_folder(), handle,
           "check that the interface in its network.xml is up");
    fail("DDS domain " + std::to_string(domain) + " cannot be opened on the loopback interface", handle, "bring it up (ip link set lo up)");
  }
  auto made = std::make_shared<Entity>(handle);
  known[domain] = made;
  return made;
}

using Qos = std::unique_ptr<dds_qos_t, decltype(&dds_delete_qos)>;

Qos quality(const Topic& topic) {
  Qos qos(dds_create_qos(), &dds_delete_qos);
  dds_qset_reliability(qos.get(), topic.reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, DDS_MSECS(100));
  const auto depth = static_cast<std::int32_t>(topic.depth == 0 ? 1 : topic.depth);
  const dds_history_kind_t kind = topic.depth == 0 ? DDS_HISTORY_KEEP_ALL : DDS_HISTORY_KEEP_LAST;
  dds_qset_history(qos.get(), kind, depth);
  dds_qset_durability(qos.get(), topic.transient_local ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  // What a late reader gets is governed by this, not by the history, and defaults to one value.
  if (topic.transient_local) {
    dds_qset_durability_service(qos.get(), 0, kind, depth, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  }
  return qos;
}

Entity make_topic(const Participant& participant, const Topic& topic) {
  const dds_entity_t handle = dds_create_topic(participant.entity(), &descriptor_of(topic), topic.name, nullptr, nullptr);
  if (handle < 0) {
    fail(std::string("DDS topic ") + topic.name + " cannot be made", handle,
         "another program may use this name with another type: give this rig a DDS domain of its own");
  }
  return Entity(handle);
}

constexpr std::size_t batch = 64;

}  // namespace

const dds_topic_descriptor_t& descriptor_of(const Topic& topic) {
  const std::array<const dds_topic_descriptor_t*, topics.size()> descriptors{
      &trocar_wire_SampleBatch_desc, &trocar_wire_FlightBatch_desc, &trocar_wire_Status_desc, &trocar_wire_Event_desc,
      &trocar_wire_Command_desc,     &trocar_wire_Reply_desc,       &trocar_wire_Markers_desc};
  for (const auto* descriptor : descriptors) {
    if (std::string_view(descriptor->m_typename) == topic.type) return *descriptor;
  }
  throw Error(std::string("no IDL type is called ") + topic.type);
}

Reach reach() {
  if (keys_folder() != nullptr) return Reach::Secured;
  return std::getenv("CYCLONEDDS_URI") != nullptr ? Reach::Open : Reach::Loopback;
}

void hush() { dds_set_log_mask(DDS_LC_FATAL); }

Participant::Participant(std::uint32_t domain) : domain_(domain) {
  if (domain > max_domain) {
    throw Error("DDS domain " + std::to_string(domain) + " does not exist; choose 0 … " + std::to_string(max_domain));
  }
  configured_domain_ = configure(domain);
  const dds_entity_t handle = dds_create_participant(domain, nullptr, nullptr);
  if (handle < 0) {
    fail("DDS domain " + std::to_string(domain) + " cannot be joined", handle,
         reach() == Reach::Secured ? "check the keys in TROCAR_KEYS: made by one authority, not expired, readable"
                                   : "end programs that are no longer needed there, choose another domain, or check CYCLONEDDS_URI");
  }
  entity_ = Entity(handle);
}

namespace detail {

Entity make_reader(const Participant& participant, const Topic& topic) {
  const Entity dds_topic = make_topic(participant, topic);  // the reader keeps it alive
  const dds_entity_t handle = dds_create_reader(participant.entity(), dds_topic.get(), quality(topic).get(), nullptr);
  if (handle < 0) fail(std::string("no reader for ") + topic.name, handle, "this is a defect of the program: report it");
  return Entity(handle);
}

Entity make_writer(const Participant& participant, const Topic& topic) {
  const Entity dds_topic = make_topic(participant, topic);
  const dds_entity_t handle = dds_create_writer(participant.entity(), dds_topic.get(), quality(topic).get(), nullptr);
  if (handle == DDS_RETCODE_NOT_ALLOWED_BY_SECURITY)
    fail(std::string("these keys may not write ") + topic.name, handle, "use the keys of another role in TROCAR_KEYS");
  if (handle < 0) fail(std::string("no writer for ") + topic.name, handle, "this is a defect of the program: report it");
  return Entity(handle);
}

std::uint32_t matched_by_reader(dds_entity_t reader) {
  dds_subscription_matched_status_t status{};
  const dds_return_t code = dds_get_subscription_matched_status(reader, &status);
  if (code != DDS_RETCODE_OK) fail("no match status", code, "the reader was closed");
  return status.current_count;
}

std::uint32_t matched_by_writer(dds_entity_t writer) {
  dds_publication_matched_status_t status{};
  const dds_return_t code = dds_get_publication_matched_status(writer, &status);
  if (code != DDS_RETCODE_OK) fail("no match status", code, "the writer was closed");
  return status.current_count;
}

bool write(dds_entity_t writer, const void* value, const Topic& topic) {
  const dds_return_t code = dds_write(writer, value);
  if (code == DDS_RETCODE_TIMEOUT) return false;
  if (code != DDS_RETCODE_OK) {
    fail(std::string(topic.name) + " was not written", code, "a text or a sequence may be longer than rig.idl allows");
  }
  return true;
}

std::size_t take(dds_entity_t reader, const Topic& topic, void (*visit)(void*, const void*, std::int64_t), void* context,
                 std::size_t at_most) {
  struct Loan {
    dds_entity_t reader;
    std::array<void*, batch> values{};
    std::int32_t count{};
    ~Loan() {
      if (count > 0) dds_return_loan(reader, values.data(), count);
    }
  };
  std::size_t taken = 0;
  while (true) {
    Loan loan{reader};
    std::array<dds_sample_info_t, batch> info{};
    const dds_return_t count = dds_take(reader, loan.values.data(), info.data(), batch, batch);
    if (count < 0) fail(std::string(topic.name) + " cannot be read", count, "the reader was closed");
    loan.count = count;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
      if (!info[i].valid_data) continue;
      visit(context, loan.values[i], info[i].source_timestamp);
      ++taken;
    }
    if (static_cast<std::size_t>(count) < batch || taken >= at_most) return taken;
  }
}

}  // namespace detail

std::size_t RawReader::take(const Visit& visit) {
  struct Taken {
    std::array<ddsi_serdata*, batch> values{};
    ~Taken() {
      for (ddsi_serdata* value : values) {
        if (value != nullptr) ddsi_serdata_unref(value);
      }
    }
  };
  std::size_t total = 0;
  std::vector<std::byte> cdr;
  while (true) {
    Taken taken;
    std::array<dds_sample_info_t, batch> info{};
    const dds_return_t count = dds_takecdr(entity_.get(), taken.values.data(), batch, info.data(), DDS_ANY_STATE);
    if (count < 0) fail(std::string(topic_->name) + " cannot be read", count, "the reader was closed");
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
      if (!info[i].valid_data) continue;
      cdr.resize(ddsi_serdata_size(taken.values[i]));
      ddsi_serdata_to_ser(taken.values[i], 0, cdr.size(), cdr.data());
      visit(cdr, info[i].source_timestamp);
      ++total;
    }
    if (static_cast<std::size_t>(count) < batch) return total;
  }
}

WaitSet::WaitSet(const Participant& participant) {
  const dds_entity_t handle = dds_create_waitset(participant.entity());
  if (handle < 0) fail("no wait set", handle, "this is a defect of the program: report it");
  entity_ = Entity(handle);
}

void WaitSet::add(dds_entity_t reader) {
  // The condition is a child of the reader and is deleted with it.
  const dds_entity_t condition = dds_create_readcondition(reader, DDS_ANY_STATE);
  if (condition < 0) fail("no read condition", condition, "the reader was closed");
  const dds_return_t code = dds_waitset_attach(entity_.get(), condition, 0);
  if (code != DDS_RETCODE_OK) fail("the wait set refuses a reader", code, "this is a defect of the program: report it");
}

bool WaitSet::wait(std::chrono::nanoseconds timeout) {
  const dds_return_t count = dds_waitset_wait(entity_.get(), nullptr, 0, timeout.count());
  if (count < 0) fail("waiting for DDS failed", count, "the participant was closed");
  return count > 0;
}

}  // namespace trocar::wire
