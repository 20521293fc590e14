#include "common/config/document.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <set>
#include <system_error>

#include "common/config/key_hint.hpp"
#include "common/config/nesting.hpp"
#include "common/config/user_error.hpp"

namespace trocar::config {
namespace {

constexpr std::uintmax_t largest_file = 1u << 20;
constexpr std::size_t longest_shown = 60;

// What a file contains may be anything: keep messages on one line, printable and short.
std::string shown(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (out.size() >= longest_shown) return out + "…";
    out += static_cast<unsigned char>(c) < 0x20 || c == 0x7F ? '?' : c;
  }
  return out;
}

std::string show(const toml::node& node) {
  if (const auto* value = node.as_string()) return fmt::format("\"{}\"", shown(value->get()));
  if (const auto* value = node.as_integer()) return fmt::format("{}", value->get());
  if (const auto* value = node.as_floating_point()) return fmt::format("{}", value->get());
  if (const auto* value = node.as_boolean()) return value->get() ? "true" : "false";
  if (const auto* array = node.as_array()) {
    std::string out;
    for (const toml::node& element : *array) {
      out += (out.empty() ? "" : ", ") + show(element);
      if (out.size() > longest_shown) return fmt::format("[{}]", shown(out));
    }
    return fmt::format("[{}]", out);
  }
  return node.is_table() ? "{…}" : "a date or time";
}

std::string type_of(const toml::node& node) {
  if (node.is_string()) return "a text";
  if (node.is_number()) return "a number";
  if (node.is_boolean()) return "true or false";
  if (const auto* array = node.as_array()) return fmt::format("an array of {}", array->size());
  return node.is_table() ? "a table" : "a date or time";
}

std::string with_remedy(std::string problem, std::string_view remedy) {
  if (!remedy.empty()) problem.append("; ").append(remedy);
  return problem;
}

// A round number inside of the range, for the example in "add a line such as".
double example_in(Range range) {
  for (const double value : {1.0, 0.1, 10.0, 0.01, 100.0, 1e-3, 1e3, 1e-4, 1e4, 1e-5, 1e5, 1e-6, 1e6}) {
    if (value >= range.min && value <= range.max) return value;
  }
  return range.min;
}

std::string example_array(std::size_t size, double value) {
  std::string text;
  for (std::size_t i = 0; i < size; ++i) text += fmt::format("{}{}", i == 0 ? "" : ", ", value);
  return fmt::format("[{}]", text);
}

std::string quoted(std::span<const std::string_view> words) {
  std::string text;
  for (const std::string_view word : words) text += fmt::format("{}\"{}\"", text.empty() ? "" : ", ", word);
  return text;
}

// Numbers of a value or of an array, for unit advice; empty when it holds anything else.
std::vector<double> numbers_in(const toml::node& node) {
  std::vector<double> values;
  if (const auto value = node.value<double>(); value && node.is_number()) values.push_back(*value);
  if (const auto* array = node.as_array()) {
    for (const toml::node& element : *array) {
      if (!element.is_number()) return {};
      values.push_back(element.value<double>().value_or(0.0));
    }
  }
  return values;
}

struct Source {
  std::string file;
  toml::table tree;
  std::map<const toml::table*, std::set<std::string, std::less<>>> asked;

  [[nodiscard]] std::string at(std::uint32_t line) const { return line == 0 ? file : fmt::format("{}:{}", file, line); }
};

}  // namespace

struct Table::View {
  std::shared_ptr<Source> source;
  const toml::table* table;
  std::string path;  // "linkage.proximal", empty for the root

  [[nodiscard]] std::string full(std::string_view key) const { return path.empty() ? shown(key) : fmt::format("{}.{}", path, shown(key)); }
  [[nodiscard]] std::uint32_t line_of(std::string_view key) const {
    const auto it = table->find(key);
    return it != table->end() ? it->first.source().begin.line : path.empty() ? 0 : table->source().begin.line;
  }
  void note(std::string_view key) const { source->asked[table].emplace(key); }

  // The value, null when absent; from now on the key is known.
  [[nodiscard]] const toml::node* find(std::string_view key) const {
    note(key);
    return table->get(key);
  }

  [[noreturn]] void fail(std::string_view key, std::string_view problem) const {
    const toml::node* node = table->get(key);
    if (node == nullptr) throw UserError(fmt::format("{}: {}: {}", source->at(line_of(key)), full(key), problem));
    // A table's own line says more than "{…}" would.
    const std::string value = node->is_table() || node->is_array_of_tables() ? "" : " = " + show(*node);
    throw UserError(fmt::format("{}: {}{}: {}", source->at(line_of(key)), full(key), value, problem));
  }

  [[noreturn]] void wrong_type(std::string_view key, std::string_view expected, std::string_view remedy) const {
    fail(key, with_remedy(fmt::format("expected {}, got {}", expected, type_of(*table->get(key))), remedy));
  }

  [[noreturn]] void missing(std::string_view key, const std::string& example, std::string_view remedy) const {
    const auto& known = source->asked[table];
    std::vector<std::string_view> unread;
    for (const auto& [name, value] : *table) {
      if (!known.contains(name.str())) unread.push_back(name.str());
    }
    for (const std::string_view other : unread) {
      if (differ_by_unit(other, key)) fail(other, fmt::format("unknown key; {}", unit_advice(other, key, numbers_in(*table->get(other)))));
    }
    std::string message = fmt::format("{}: {}: missing{}; add a line such as {} = {}", source->at(line_of(key)), full(key),
                                      path.empty() ? "" : fmt::format(" in [{}]", path), key, example);
    if (!remedy.empty()) message += fmt::format(" ({})", remedy);
    if (const std::string_view like = nearest(key, unread); !like.empty()) {
      message += fmt::format(". Line {} has {}: was {} meant?", line_of(like), shown(like), key);
    }
    throw UserError(message);
  }

  [[nodiscard]] double finite_number(std::string_view key, const toml::node& node, Range range, std::string_view remedy) const {
    const double value = node.value<double>().value_or(std::nan(""));
    if (!std::isfinite(value)) fail(key, with_remedy("must be a finite number", remedy));
    if (value >= range.min && value <= range.max) return value;
    std::string problem = fmt::format("must be from {} to {}", range.min, range.max);
    if (const std::string advice = range_advice(key, value, range); !advice.empty()) problem += "; " + advice;
    fail(key, with_remedy(problem, remedy));
  }

  [[nodiscard]] std::int64_t whole_number(std::string_view key, const toml::node& node, std::int64_t min, std::int64_t max,
                                          std::string_view remedy) const {
    if (node.is_floating_point()) fail(key, with_remedy("expected a whole number, without a decimal point or exponent", remedy));
    const std::int64_t value = node.as_integer()->get();
    if (value < min || value > max) fail(key, with_remedy(fmt::format("must be from {} to {}", min, max), remedy));
    return value;
  }

  [[nodiscard]] const toml::array& array_of(std::string_view key, const toml::node& node, const std::string& expected,
                                            std::string_view remedy) const {
    const toml::array* array = node.as_array();
    if (array == nullptr || array->empty()) wrong_type(key, expected, remedy);
    for (const toml::node& element : *array) {
      if (!element.is_number()) fail(key, with_remedy(fmt::format("expected {}, found {} among them", expected, show(element)), remedy));
    }
    return *array;
  }
};

double Table::number(std::string_view key, Range range, std::string_view remedy) const {
  const toml::node* node = view_->find(key);
  if (node == nullptr) view_->missing(key, fmt::format("{}", example_in(range)), remedy);
  if (!node->is_number()) view_->wrong_type(key, "a number", remedy);
  return view_->finite_number(key, *node, range, remedy);
}

double Table::number_or(std::string_view key, double otherwise, Range range, std::string_view remedy) const {
  return has(key) ? number(key, range, remedy) : otherwise;
}

std::int64_t Table::integer(std::string_view key, std::int64_t min, std::int64_t max, std::string_view remedy) const {
  const toml::node* node = view_->find(key);
  if (node == nullptr) view_->missing(key, fmt::format("{}", std::clamp<std::int64_t>(1, min, max)), remedy);
  if (!node->is_number()) view_->wrong_type(key, "a whole number", remedy);
  return view_->whole_number(key, *node, min, max, remedy);
}

std::int64_t Table::integer_or(std::string_view key, std::int64_t otherwise, std::int64_t min, std::int64_t max,
                               std::string_view remedy) const {
  return has(key) ? integer(key, min, max, remedy) : otherwise;
}

std::string Table::text(std::string_view key, std::string_view remedy) const {
  const toml::node* node = view_->find(key);
  if (node == nullptr) view_->missing(key, "\"…\"", remedy);
  if (!node->is_string()) view_->wrong_type(key, "a text in quotes", remedy);
  const std::string& value = node->as_string()->get();
  if (value.empty()) view_->fail(key, with_remedy("must not be empty", remedy));
  return value;
}

std::string Table::text_or(std::string_view key, std::string_view otherwise, std::string_view remedy) const {
  return has(key) ? text(key, remedy) : std::string(otherwise);
}

bool Table::flag(std::string_view key, std::string_view remedy) const {
  const toml::node* node = view_->find(key);
  if (node == nullptr) view_->missing(key, "true", remedy);
  if (!node->is_boolean()) view_->wrong_type(key, "true or false, without quotes", remedy);
  return node->as_boolean()->get();
}

bool Table::flag_or(std::string_view key, bool otherwise, std::string_view remedy) const {
  return has(key) ? flag(key, remedy) : otherwise;
}

std::string Table::one_of(std::string_view key, std::initializer_list<std::string_view> allowed) const {
  const std::span<const std::string_view> words(allowed.begin(), allowed.size());
  const std::string rule = fmt::format("write one of {}", quoted(words));
  const toml::node* node = view_->find(key);
  if (node == nullptr) view_->missing(key, fmt::format("\"{}\"", words.front()), rule);
  if (!node->is_string()) view_->wrong_type(key, "a text in quotes", rule);
  std::string value = node->as_string()->get();
  if (std::find(words.begin(), words.end(), value) != words.end()) return value;
  const std::string_view like = nearest(value, words);
  view_->fail(key, with_remedy(like.empty() ? "not known here" : fmt::format("not known here, did you mean \"{}\"?", like), rule));
}

std::string Table::one_of_or(std::string_view key, std::string_view otherwise, std::initializer_list<std::string_view> allowed) const {
  return has(key) ? one_of(key, allowed) : std::string(otherwise);
}

void Table::read_numbers(std::string_view key, std::span<double> values, Range range, std::string_view remedy) const {
  const std::string expected = fmt::format("an array of {} numbers", values.size());
  const toml::node* node = view_->find(key);
  if (node == nullptr) view_->missing(key, example_array(values.size(), example_in(range)), remedy);
  const toml::array& array = view_->array_of(key, *node, expected, remedy);
  if (array.size() != values.size()) fail(key, with_remedy(fmt::format("expected {}, got {}", expected, array.size()), remedy));
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = view_->finite_number(key, array[i], range, remedy);
}

void Table::read_integers(std::string_view key, std::span<std::int64_t> values, std::int64_t min, std::int64_t max,
                          std::string_view remedy) const {
  const std::string expected = fmt::format("an array of {} whole numbers", values.size());
  const toml::node* node = view_->find(key);
  if (node == nullptr)
    view_->missing(key, example_array(values.size(), static_cast<double>(std::clamp<std::int64_t>(1, min, max))), remedy);
  const toml::array& array = view_->array_of(key, *node, expected, remedy);
  if (array.size() != values.size()) fail(key, with_remedy(fmt::format("expected {}, got {}", expected, array.size()), remedy));
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = view_->whole_number(key, array[i], min, max, remedy);
}

std::vector<double> Table::list(std::string_view key, Range range, std::string_view remedy) const {
  const toml::node* node = view_->find(key);
  if (node == nullptr) view_->missing(key, example_array(1, example_in(range)), remedy);
  std::vector<double> values;
  for (const toml::node& element : view_->array_of(key, *node, "an array of numbers", remedy)) {
    values.push_back(view_->finite_number(key, element, range, remedy));
  }
  return values;
}

std::vector<std::string> Table::texts(std::string_view key, std::initializer_list<std::string_view> allowed) const {
  const std::span<const std::string_view> words(allowed.begin(), allowed.size());
  const std::string rule = fmt::format("choose from {}", quoted(words));
  const toml::node* node = view_->find(key);
  if (node == nullptr) view_->missing(key, fmt::format("[\"{}\"]", words.front()), rule);
  const toml::array* array = node->as_array();
  if (array == nullptr || array->empty()) view_->wrong_type(key, "an array of texts in quotes", rule);
  std::vector<std::string> values;
  for (const toml::node& element : *array) {
    const toml::value<std::string>* text = element.as_string();
    if (text == nullptr || std::find(words.begin(), words.end(), text->get()) == words.end()) {
      fail(key, with_remedy(fmt::format("{} is not known here", show(element)), rule));
    }
    values.push_back(text->get());
  }
  return values;
}

std::vector<std::vector<double>> Table::rows(std::string_view key, std::size_t columns, Range range, std::string_view remedy) const {
  const std::string expected = fmt::format("an array of arrays of {} numbers", columns);
  const toml::node* node = view_->find(key);
  if (node == nullptr) view_->missing(key, fmt::format("[{}]", example_array(columns, example_in(range))), remedy);
  const toml::array* array = node->as_array();
  if (array == nullptr || array->empty()) view_->wrong_type(key, expected, remedy);
  std::vector<std::vector<double>> values;
  for (const toml::node& element : *array) {
    const toml::array* row = element.as_array();
    if (row == nullptr || row->size() != columns || !std::all_of(row->begin(), row->end(), [](const auto& n) { return n.is_number(); })) {
      fail(key, with_remedy(fmt::format("expected {}, found {} among them", expected, show(element)), remedy));
    }
    std::vector<double>& numbers = values.emplace_back();
    for (const toml::node& number : *row) numbers.push_back(view_->finite_number(key, number, range, remedy));
  }
  return values;
}

Table Table::table(std::string_view key) const {
  if (auto found = optional_table(key)) return *found;
  const std::string header = view_->full(key);
  throw UserError(fmt::format("{}: {}: missing; add the table [{}]", view_->source->at(view_->line_of(key)), header, header));
}

std::optional<Table> Table::optional_table(std::string_view key) const {
  const toml::node* node = view_->find(key);
  if (node == nullptr) return std::nullopt;
  if (!node->is_table()) view_->wrong_type(key, "a table", fmt::format("write [{}] and its keys below", view_->full(key)));
  return Table(std::make_shared<const View>(View{view_->source, node->as_table(), view_->full(key)}));
}

std::vector<Table> Table::tables(std::string_view key) const {
  const toml::node* node = view_->find(key);
  if (node == nullptr) return {};
  const toml::array* array = node->as_array();
  const std::string remedy = fmt::format("write [[{}]] and its keys below, once for each", view_->full(key));
  if (array == nullptr) view_->wrong_type(key, "an array of tables", remedy);
  std::vector<Table> found;
  for (const toml::node& element : *array) {
    if (!element.is_table()) view_->wrong_type(key, "an array of tables", remedy);
    found.emplace_back(std::make_shared<const View>(View{view_->source, element.as_table(), view_->full(key)}));
  }
  return found;
}

std::vector<std::optional<Table>> Table::words_and_tables(std::string_view key, std::initializer_list<std::string_view> allowed,
                                                          std::string_view remedy) const {
  const toml::node* node = view_->find(key);
  if (node == nullptr) view_->missing(key, fmt::format("[\"{}\"]", *allowed.begin()), remedy);
  const toml::array* array = node->as_array();
  if (array == nullptr || array->empty()) view_->wrong_type(key, "an array of texts and tables", remedy);
  std::vector<std::optional<Table>> entries;
  for (const toml::node& element : *array) {
    if (const toml::table* table = element.as_table()) {
      entries.emplace_back(Table(std::make_shared<const View>(View{view_->source, table, view_->full(key)})));
      continue;
    }
    const toml::value<std::string>* text = element.as_string();
    if (text == nullptr || std::find(allowed.begin(), allowed.end(), text->get()) == allowed.end())
      fail(key, with_remedy(fmt::format("{} is not known here", show(element)), remedy));
    entries.emplace_back(std::nullopt);
  }
  return entries;
}

bool Table::has(std::string_view key) const { return view_->find(key) != nullptr; }

void Table::fail(std::string_view key, std::string_view problem_and_remedy) const { view_->fail(key, problem_and_remedy); }

std::string Table::where(std::string_view key) const { return view_->source->at(view_->line_of(key)); }

Document Document::load(const std::filesystem::path& file) {
  const std::string name = file.string();
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (status.type() == std::filesystem::file_type::not_found) {
    throw UserError(fmt::format("{}: there is no such file; check the path (paths are relative to the current folder)", name));
  }
  if (error)
    throw UserError(fmt::format("{}: cannot be opened: {}; check the permissions of the file and its folders", name, error.message()));
  if (status.type() == std::filesystem::file_type::directory) {
    throw UserError(fmt::format("{}: this is a folder; name a TOML file in it", name));
  }
  if (status.type() != std::filesystem::file_type::regular) throw UserError(fmt::format("{}: not a regular file; name a TOML file", name));

  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) {
    throw UserError(fmt::format("{}: cannot be opened: {}; check the permissions of the file", name, std::strerror(errno)));
  }
  std::string content;
  std::array<char, 16384> piece;
  while (content.size() <= largest_file && (stream.read(piece.data(), piece.size()), stream.gcount() > 0))
    content.append(piece.data(), static_cast<std::size_t>(stream.gcount()));
  if (stream.bad()) throw UserError(fmt::format("{}: cannot be read: {}; check the disk", name, std::strerror(errno)));
  if (content.size() > largest_file) {
    throw UserError(
        fmt::format("{}: larger than {} KiB; no configuration is: check that this is the right file", name, largest_file / 1024));
  }
  if (const std::size_t line = line_nested_too_deep(content); line != 0) {
    throw UserError(
        fmt::format("{}:{}: nested deeper than {} levels; no configuration needs that: check the brackets and dots of this line", name,
                    line, nesting_limit));
  }

  auto source = std::make_shared<Source>();
  source->file = name;
  try {
    source->tree = toml::parse(content, name);
  } catch (const toml::parse_error& malformed) {
    const toml::source_position at = malformed.source().begin;
    std::string reason;
    for (const char c : malformed.description()) reason += static_cast<unsigned char>(c) < 0x20 ? '?' : c;
    throw UserError(fmt::format("{}:{}:{}: not valid TOML: {}; correct this line", name, at.line, at.column, reason));
  }
  const toml::table* root = &source->tree;
  return Document(std::make_shared<const Table::View>(Table::View{std::move(source), root, {}}));
}

Table Document::root() const { return Table(root_); }

namespace {

struct Unknown {
  const toml::table* table{};
  std::string path;
  std::string key;
  std::uint32_t line{};
};

// The unread key that stands first in the file.
void find_unknown(const Source& source, const toml::table& table, const std::string& path, Unknown& first) {
  const auto asked = source.asked.find(&table);
  for (const auto& [key, node] : table) {
    const std::string full = path.empty() ? shown(key.str()) : fmt::format("{}.{}", path, shown(key.str()));
    if (asked == source.asked.end() || !asked->second.contains(key.str())) {
      const std::uint32_t line = key.source().begin.line;
      if (first.table == nullptr || line < first.line) first = Unknown{&table, full, std::string(key.str()), line};
    } else if (const toml::table* child = node.as_table()) {
      find_unknown(source, *child, full, first);
    } else if (const toml::array* array = node.as_array()) {
      for (const toml::node& element : *array) {
        if (const toml::table* entry = element.as_table()) find_unknown(source, *entry, full, first);
      }
    }
  }
}

}  // namespace

void Document::refuse_unknown_keys() const {
  const Source& source = *root_->source;
  Unknown first;
  find_unknown(source, source.tree, {}, first);
  if (first.table == nullptr) return;

  std::vector<std::string_view> known;
  if (const auto asked = source.asked.find(first.table); asked != source.asked.end())
    known.assign(asked->second.begin(), asked->second.end());
  const toml::node& node = *first.table->get(first.key);
  const std::string_view like = nearest(first.key, known);
  std::string advice = "remove it";
  if (!like.empty()) {
    advice = differ_by_unit(first.key, like) ? unit_advice(first.key, like, numbers_in(node)) : fmt::format("did you mean {}?", like);
  } else if (!known.empty()) {
    advice = fmt::format("remove it; known here: {}", fmt::join(known, ", "));
  }
  const std::string value = node.is_table() || node.is_array_of_tables() ? "" : " = " + show(node);
  throw UserError(fmt::format("{}: {}{}: unknown key; {}", source.at(first.line), first.path, value, advice));
}

}  // namespace trocar::config
