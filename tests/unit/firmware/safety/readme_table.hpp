// Tables in a README that a test holds to what it measured: between "<!-- NAME: begin -->" and "<!-- NAME: end -->".
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace trocar::testing {

// `readme` from the root of the repository. With TROCAR_WRITE_TABLES set, it is brought up to date instead.
inline void expect_shown(const std::string& readme, const std::string& name, const std::string& table) {
  const std::filesystem::path file = std::filesystem::path(TROCAR_SOURCE) / readme;
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  const std::string all = text.str(), begin = "<!-- " + name + ": begin -->\n", end = "<!-- " + name + ": end -->";
  const std::size_t from = all.find(begin), to = all.find(end);
  ASSERT_NE(from, std::string::npos) << begin;
  ASSERT_NE(to, std::string::npos) << end;
  const std::size_t at = from + begin.size();
  if (std::getenv("TROCAR_WRITE_TABLES") != nullptr) {
    std::ofstream(file) << all.substr(0, at) + table + all.substr(to);
    return;
  }
  EXPECT_EQ(all.substr(at, to - at), table) << "run this test with TROCAR_WRITE_TABLES=1 to bring " << readme << " up to date";
}

}  // namespace trocar::testing
