// Thin ownership over the Cyclone DDS C API: participant, reader, writer, wait set. Errors are exceptions that say what to do.
// For threads that may allocate and wait only: writing a sample allocates.
// Traffic stays on the loopback interface, unless TROCAR_KEYS names a folder of keys (host/keys): then it goes where these say, signed and
// encrypted, among those whose keys are of the same authority. CYCLONEDDS_URI alone makes an open network. SECURITY.md says what that
// means.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "common/wire/types.hpp"
#include "dds/dds.h"

namespace trocar::wire {

struct Error : std::runtime_error {
  using std::runtime_error::runtime_error;
};

inline constexpr std::uint32_t max_domain = 230;  // the last one whose UDP ports (7400 + 250 domain …) exist

// Owns one DDS entity.
class Entity {
 public:
  Entity() = default;
  explicit Entity(dds_entity_t handle) noexcept : handle_(handle) {}
  Entity(Entity&& other) noexcept : handle_(std::exchange(other.handle_, 0)) {}
  Entity& operator=(Entity&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  Entity(const Entity&) = delete;
  Entity& operator=(const Entity&) = delete;
  ~Entity() {
    if (handle_ > 0) dds_delete(handle_);
  }
  [[nodiscard]] dds_entity_t get() const noexcept { return handle_; }

 private:
  dds_entity_t handle_{};
};

enum class Reach : std::uint8_t {
  Loopback,
  Secured,  // TROCAR_KEYS
  Open,     // CYCLONEDDS_URI: whoever is there may command
};
[[nodiscard]] Reach reach();

// From now on Cyclone keeps to itself what it would print: a command says one line, its own. The rig's process lets it speak, of strangers
// that knock for instance.
void hush();

class Participant {
 public:
  explicit Participant(std::uint32_t domain);
  [[nodiscard]] dds_entity_t entity() const noexcept { return entity_.get(); }
  [[nodiscard]] std::uint32_t domain() const noexcept { return domain_; }

 private:
  std::uint32_t domain_;
  std::shared_ptr<Entity> configured_domain_;  // shared by the process's participants of one domain; outlives entity_
  Entity entity_;
};

namespace detail {
[[nodiscard]] Entity make_reader(const Participant& participant, const Topic& topic);
[[nodiscard]] Entity make_writer(const Participant& participant, const Topic& topic);
[[nodiscard]] std::uint32_t matched_by_reader(dds_entity_t reader);
[[nodiscard]] std::uint32_t matched_by_writer(dds_entity_t writer);
[[nodiscard]] bool write(dds_entity_t writer, const void* value, const Topic& topic);
// Takes what is there and hands every valid value to visit(context, value, source time).
std::size_t take(dds_entity_t reader, const Topic& topic, void (*visit)(void*, const void*, std::int64_t), void* context,
                 std::size_t at_most);
}  // namespace detail

template <Topical T>
class Reader {
 public:
  explicit Reader(const Participant& participant) : entity_(detail::make_reader(participant, topic_of<T>)) {}

  // Takes everything that has arrived, or `at_most` (rounded up to 64): a writer that is fast enough would keep it busy for ever.
  // visit(const T&) or visit(const T&, std::int64_t written_ns). Returns how many.
  template <class Visit>
  std::size_t take(Visit&& visit, std::size_t at_most = std::numeric_limits<std::size_t>::max()) {
    auto call = [](void* context, const void* value, [[maybe_unused]] std::int64_t written_ns) {
      auto& function = *static_cast<std::remove_reference_t<Visit>*>(context);
      if constexpr (std::is_invocable_v<Visit&, const T&, std::int64_t>) {
        function(*static_cast<const T*>(value), written_ns);
      } else {
        function(*static_cast<const T*>(value));
      }
    };
    return detail::take(entity_.get(), topic_of<T>, call, const_cast<void*>(static_cast<const void*>(std::addressof(visit))), at_most);
  }
  [[nodiscard]] std::uint32_t matched() const { return detail::matched_by_reader(entity_.get()); }  // writers seen now
  [[nodiscard]] dds_entity_t entity() const noexcept { return entity_.get(); }

 private:
  Entity entity_;
};

template <Topical T>
class Writer {
 public:
  explicit Writer(const Participant& participant) : entity_(detail::make_writer(participant, topic_of<T>)) {}

  // False when a reader did not keep up with a reliable topic for 100 ms; the value is then not sent.
  [[nodiscard]] bool write(const T& value) { return detail::write(entity_.get(), &value, topic_of<T>); }
  [[nodiscard]] std::uint32_t matched() const { return detail::matched_by_writer(entity_.get()); }  // readers seen now
  [[nodiscard]] dds_entity_t entity() const noexcept { return entity_.get(); }

 private:
  Entity entity_;
};

// Receives samples as the bytes that were on the wire: 4-byte encapsulation header, then CDR.
class RawReader {
 public:
  RawReader(const Participant& participant, const Topic& topic) : topic_(&topic), entity_(detail::make_reader(participant, topic)) {}

  using Visit = std::function<void(std::span<const std::byte> cdr, std::int64_t written_ns)>;
  std::size_t take(const Visit& visit);
  [[nodiscard]] const Topic& topic() const noexcept { return *topic_; }
  [[nodiscard]] std::uint32_t matched() const { return detail::matched_by_reader(entity_.get()); }
  [[nodiscard]] dds_entity_t entity() const noexcept { return entity_.get(); }

 private:
  const Topic* topic_;
  Entity entity_;
};

// Sleeps until one of its readers has something to take.
class WaitSet {
 public:
  explicit WaitSet(const Participant& participant);
  void add(dds_entity_t reader);
  bool wait(std::chrono::nanoseconds timeout);  // false when the time is up

 private:
  Entity entity_;
};

}  // namespace trocar::wire
