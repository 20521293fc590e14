// Tables of numbers: a header line that names the columns with their units, then one line a row, separated by commas.
//   t_s,x_m
//   0.0,0.1
// Spaces around fields, CRLF line ends, a byte-order mark and empty lines are tolerated; everything else that is not the table ends in one
// UserError with FILE:LINE, what stands there and what to write.
#pragma once

#include <cstddef>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

namespace trocar::config {

enum class NotANumber { Refused, Allowed };  // "nan", where a table says so of what is missing

class Csv {
 public:
  // `headers`: the header lines that the caller can use, such as {"x_m,y_m,fx_n,fy_n"}; names and order must be those of one of them.
  // Throws UserError: a file that cannot be read, another header, a row with fewer or more fields, a field that is no finite number, no
  // rows.
  static Csv load(const std::filesystem::path& file, std::initializer_list<std::string_view> headers, NotANumber nan = NotANumber::Refused);

  [[nodiscard]] std::size_t header() const { return header_; }  // index of the header that the file has
  [[nodiscard]] std::size_t columns() const { return columns_; }
  [[nodiscard]] std::size_t rows() const { return line_.size(); }
  [[nodiscard]] double operator()(std::size_t row, std::size_t column) const { return value_[row * columns_ + column]; }
  [[nodiscard]] std::string where(std::size_t row) const;  // "FILE:LINE"
  [[noreturn]] void fail(std::size_t row, std::string_view problem_and_remedy) const;

 private:
  std::string file_{};
  std::size_t header_{};
  std::size_t columns_{};
  std::vector<double> value_{};
  std::vector<std::size_t> line_{};  // of each row, from 1
};

}  // namespace trocar::config
