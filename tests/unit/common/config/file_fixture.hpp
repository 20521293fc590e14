// Files that tests write, read and forget, and the check of one error message against its parts.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <string>
#include <string_view>

#include "common/config/user_error.hpp"

namespace trocar::config::testing {

class FileFixture : public ::testing::Test {
 protected:
  FileFixture() {
    std::string pattern = (std::filesystem::temp_directory_path() / "trocar_config_XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
  }
  ~FileFixture() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path write(std::string_view text) const {
    auto file = folder_ / "file.toml";
    std::ofstream(file, std::ios::binary) << text;
    return file;
  }

  // The message that reading `text` ends in.
  template <class Read>
  std::string error_of(std::string_view text, Read read) const {
    const auto file = write(text);
    return error_from([&] { static_cast<void>(read(file)); });
  }

  template <class Action>
  static std::string error_from(Action action) {
    try {
      action();
    } catch (const UserError& error) {
      return error.what();
    }
    return "(nothing was refused)";
  }

  std::filesystem::path folder_;
};

// Every part occurs, each after the one before.
inline void expect_parts(const std::string& message, std::initializer_list<std::string> parts) {
  std::size_t from = 0;
  for (const std::string& part : parts) {
    const std::size_t at = message.find(part, from);
    ASSERT_NE(at, std::string::npos) << "\"" << part << "\" is missing, or out of order, in: " << message;
    from = at + part.size();
  }
  EXPECT_EQ(message.find('\n'), std::string::npos) << "more than one line: " << message;
}

struct Edited {
  std::string text;
  std::string line;  // "file.toml:LINE:" of what was put in
};

// `base` with the single occurrence of `from` replaced.
inline Edited edited(std::string_view base, std::string_view from, std::string_view to) {
  const std::size_t at = base.find(from);
  EXPECT_NE(at, std::string_view::npos) << from;
  EXPECT_EQ(base.find(from, at + 1), std::string_view::npos) << from << " occurs twice";
  if (at == std::string_view::npos) return {};
  std::string text(base);
  text.replace(at, from.size(), to);
  const auto newlines = std::count(base.begin(), base.begin() + static_cast<std::ptrdiff_t>(at), '\n');
  return {text, "file.toml:" + std::to_string(newlines + 1) + ":"};
}

}  // namespace trocar::config::testing
