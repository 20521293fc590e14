#include "common/config/csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <system_error>

#include "common/config/key_hint.hpp"
#include "common/config/user_error.hpp"

namespace trocar::config {
namespace {

constexpr std::size_t longest_line = 4096;
constexpr std::size_t longest_shown = 60;

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t' || text.back() == '\r')) text.remove_suffix(1);
  return text;
}

std::vector<std::string_view> fields_of(std::string_view line) {
  std::vector<std::string_view> fields;
  for (;;) {
    const std::size_t comma = line.find(',');
    fields.push_back(trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

// What a file contains may be anything: keep messages on one line, printable and short.
std::string shown(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, longest_shown)) out += static_cast<unsigned char>(c) < 0x20 || c == 0x7F ? '?' : c;
  return text.size() > longest_shown ? out + "…" : out;
}

std::string header_problem(std::string_view line, std::initializer_list<std::string_view> headers) {
  const std::vector<std::string_view> found = fields_of(line);
  std::string problem = fmt::format("the header is \"{}\"; write {}", shown(line), fmt::join(headers, " or "));
  for (const std::string_view header : headers) {
    const std::vector<std::string_view> wanted = fields_of(header);
    if (found.size() != wanted.size()) continue;
    for (std::size_t i = 0; i < found.size(); ++i)
      if (found[i].size() < longest_shown && differ_by_unit(found[i], wanted[i]))
        return fmt::format("{} (in column {}: {})", problem, i + 1, unit_advice(found[i], wanted[i], {}));
  }
  if (line.find(';') != std::string_view::npos) problem += " (commas separate columns, not semicolons)";
  return problem;
}

}  // namespace

Csv Csv::load(const std::filesystem::path& file, std::initializer_list<std::string_view> headers, NotANumber nan) {
  Csv csv;
  csv.file_ = file.string();
  const auto refuse = [&csv](const std::string& problem) { throw UserError(fmt::format("{}: {}", csv.file_, problem)); };
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (status.type() == std::filesystem::file_type::not_found)
    refuse("there is no such file; check the path (paths are relative to the current folder)");
  if (status.type() == std::filesystem::file_type::directory) refuse("this is a folder; name a CSV file in it");
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) refuse(fmt::format("cannot be opened: {}; check the permissions of the file", std::strerror(errno)));

  std::string line;
  std::size_t number = 0;
  while (std::getline(stream, line)) {
    ++number;
    const auto refuse_line = [&](const std::string& problem) { throw UserError(fmt::format("{}:{}: {}", csv.file_, number, problem)); };
    std::string_view text = line;
    if (text.size() > longest_line) refuse_line("the line is too long for a table of numbers; check that this is the right file");
    if (number == 1 && text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
    text = trimmed(text);
    if (text.empty()) continue;
    const std::vector<std::string_view> fields = fields_of(text);
    if (csv.columns_ == 0) {
      for (const std::string_view header : headers) {
        if (fields == fields_of(header)) break;
        ++csv.header_;
      }
      if (csv.header_ == headers.size()) refuse_line(header_problem(text, headers));
      csv.columns_ = fields.size();
      continue;
    }
    const std::vector<std::string_view> names = fields_of(headers.begin()[csv.header_]);
    if (fields.size() != csv.columns_)
      refuse_line(fmt::format("{} fields, the header has {}; write one number for each of {}", fields.size(), csv.columns_,
                              headers.begin()[csv.header_]));
    for (std::size_t i = 0; i < fields.size(); ++i) {
      double value = 0.0;
      const std::string_view digits = fields[i].starts_with('+') ? fields[i].substr(1) : fields[i];
      const auto [end, code] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
      if (code == std::errc::result_out_of_range && end == digits.data() + digits.size())
        refuse_line(fmt::format("{} = {}: too large or too small for a number", names[i], shown(fields[i])));
      if (code != std::errc() || end != digits.data() + digits.size())
        refuse_line(fmt::format("{} = \"{}\": not a number; write one such as 0.05 or -1.5e-3", names[i], shown(fields[i])));
      if (!std::isfinite(value) && !(std::isnan(value) && nan == NotANumber::Allowed))
        refuse_line(fmt::format("{} = {}: must be a finite number", names[i], shown(fields[i])));
      csv.value_.push_back(value);
    }
    csv.line_.push_back(number);
  }
  if (stream.bad()) refuse(fmt::format("cannot be read: {}; check the disk", std::strerror(errno)));
  if (csv.columns_ == 0) refuse(fmt::format("is empty; begin with the header line {}", fmt::join(headers, " or ")));
  if (csv.line_.empty()) refuse("has no rows below its header; add at least one");
  return csv;
}

std::string Csv::where(std::size_t row) const { return fmt::format("{}:{}", file_, line_[row]); }

void Csv::fail(std::size_t row, std::string_view problem_and_remedy) const {
  throw UserError(fmt::format("{}: {}", where(row), problem_and_remedy));
}

}  // namespace trocar::config
