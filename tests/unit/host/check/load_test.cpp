#include "host/check/load.hpp"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <chrono>

#include "common/config/user_error.hpp"

namespace trocar::check {
namespace {

namespace fs = std::filesystem;

TEST(Load, KeepsMemoryAndDiskBusyAndLeavesNothing) {
  std::string name = (fs::temp_directory_path() / "trocar-load-test-XXXXXX").string();
  const fs::path folder = ::mkdtemp(name.data());
  {
    const Load load(folder);
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while ((load.sweeps() == 0 || load.written_bytes() == 0) && std::chrono::steady_clock::now() < end) std::this_thread::yield();
    EXPECT_GT(load.sweeps(), 0u);
    EXPECT_GT(load.written_bytes(), 0u);
    EXPECT_NE(load.describe().find(folder.string()), std::string::npos);
    EXPECT_TRUE(fs::is_empty(folder));  // a file without a name cannot be left behind
  }
  fs::remove_all(folder);
}

TEST(Load, RefusesAFolderThatItCannotWriteTo) { EXPECT_THROW(Load("/nowhere/at/all"), config::UserError); }

}  // namespace
}  // namespace trocar::check
