#include "common/config/new_file.hpp"

#include <iterator>

#include "file_fixture.hpp"

namespace trocar::config {
namespace {

using testing::expect_parts;

class NewFileTest : public testing::FileFixture {
 protected:
  std::string read(const std::string& name) const {
    std::ifstream stream(folder_ / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  std::ptrdiff_t files() const { return std::distance(std::filesystem::directory_iterator(folder_), {}); }
};

TEST_F(NewFileTest, ReplacesOnlyWhenKept) {
  write("earlier");
  {
    NewFile file(folder_ / "file.toml");
    file.stream() << "later";
    file.stream().flush();
    EXPECT_EQ(read("file.toml"), "earlier");
    file.keep();
  }
  EXPECT_EQ(read("file.toml"), "later");
  EXPECT_EQ(files(), 1);
}

TEST_F(NewFileTest, LeavesNothingBehindWhenGivenUp) {
  {
    NewFile file(folder_ / "new.csv");
    file.stream() << "half";
  }
  EXPECT_EQ(files(), 0);
}

TEST_F(NewFileTest, NamesPlacesThatCannotBeWritten) {
  expect_parts(error_from([&] { NewFile file(folder_); }), {"this is a folder"});
  expect_parts(error_from([&] { NewFile file("/dev/null"); }), {"/dev/null: not a regular file"});
  expect_parts(error_from([&] { NewFile file(folder_ / "none" / "u.csv"); }), {"none/u.csv: cannot be written: No such file"});
  // Tests may run as root, whom no permission stops: /dev/full does, but it is a device; so write behind the stream's back.
  NewFile file(folder_ / "u.csv");
  file.stream().setstate(std::ios::failbit);
  expect_parts(error_from([&] { file.keep(); }), {"u.csv: cannot be written"});
}

}  // namespace
}  // namespace trocar::config
