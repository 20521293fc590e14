// Reading TOML so that a mistake in a file ends in one message which says where it is and what to do.
// Every reader throws UserError. Numbers are finite, within their range, and in the unit that ends the key's name
// (a key in another unit, base_mm for base_m, is answered with the converted value). `remedy` completes the message
// after "; " and should say what a good value is, for example "the distance between the motor axes, such as 0.08".
// A document reads at most 1 MiB and 16 levels of nesting, so that no file can exhaust memory or stack.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace trocar::config {

// Both ends are allowed.
struct Range {
  double min;
  double max;
};

// One table of a document. Remembers which keys were asked for. Copies are cheap and keep the document alive.
class Table {
 public:
  struct View;  // in document.cpp
  explicit Table(std::shared_ptr<const View> view) : view_(std::move(view)) {}

  double number(std::string_view key, Range range, std::string_view remedy) const;
  double number_or(std::string_view key, double otherwise, Range range, std::string_view remedy) const;
  std::int64_t integer(std::string_view key, std::int64_t min, std::int64_t max, std::string_view remedy) const;
  std::int64_t integer_or(std::string_view key, std::int64_t otherwise, std::int64_t min, std::int64_t max, std::string_view remedy) const;
  std::string text(std::string_view key, std::string_view remedy) const;
  std::string text_or(std::string_view key, std::string_view otherwise, std::string_view remedy = {}) const;
  bool flag(std::string_view key, std::string_view remedy = {}) const;
  bool flag_or(std::string_view key, bool otherwise, std::string_view remedy = {}) const;
  std::string one_of(std::string_view key, std::initializer_list<std::string_view> allowed) const;
  std::string one_of_or(std::string_view key, std::string_view otherwise, std::initializer_list<std::string_view> allowed) const;

  template <std::size_t N>
  std::array<double, N> numbers(std::string_view key, Range range, std::string_view remedy) const {
    std::array<double, N> values{};
    read_numbers(key, values, range, remedy);
    return values;
  }
  template <std::size_t N>
  std::array<double, N> numbers_or(std::string_view key, const std::array<double, N>& otherwise, Range range,
                                   std::string_view remedy) const {
    return has(key) ? numbers<N>(key, range, remedy) : otherwise;
  }
  template <std::size_t N>
  std::array<std::int64_t, N> integers(std::string_view key, std::int64_t min, std::int64_t max, std::string_view remedy) const {
    std::array<std::int64_t, N> values{};
    read_integers(key, values, min, max, remedy);
    return values;
  }
  std::vector<double> list(std::string_view key, Range range, std::string_view remedy) const;  // any length but 0
  std::vector<std::string> texts(std::string_view key, std::initializer_list<std::string_view> allowed) const;
  // [[…], […]] with `columns` numbers in each row; any number of rows but 0.
  std::vector<std::vector<double>> rows(std::string_view key, std::size_t columns, Range range, std::string_view remedy) const;

  Table table(std::string_view key) const;
  std::optional<Table> optional_table(std::string_view key) const;
  std::vector<Table> tables(std::string_view key) const;  // [[key]], empty when there is none
  // An array of words, each from `allowed` (nothing in its place), and of tables.
  std::vector<std::optional<Table>> words_and_tables(std::string_view key, std::initializer_list<std::string_view> allowed,
                                                     std::string_view remedy) const;
  bool has(std::string_view key) const;  // and marks the key as known

  // Ends with an error at that key's line (at the table's line when the key is absent).
  [[noreturn]] void fail(std::string_view key, std::string_view problem_and_remedy) const;
  [[nodiscard]] std::string where(std::string_view key) const;  // "FILE:LINE" of that key

 private:
  void read_numbers(std::string_view key, std::span<double> values, Range range, std::string_view remedy) const;
  void read_integers(std::string_view key, std::span<std::int64_t> values, std::int64_t min, std::int64_t max,
                     std::string_view remedy) const;
  std::shared_ptr<const View> view_;
};

class Document {
 public:
  static Document load(const std::filesystem::path& file);
  [[nodiscard]] Table root() const;
  // Call when everything was read: the first key that nobody asked for is an error, with the nearest key that was.
  void refuse_unknown_keys() const;

 private:
  explicit Document(std::shared_ptr<const Table::View> root) : root_(std::move(root)) {}
  std::shared_ptr<const Table::View> root_;
};

}  // namespace trocar::config
