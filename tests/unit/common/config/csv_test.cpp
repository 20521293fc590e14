#include "common/config/csv.hpp"

#include <cmath>

#include "file_fixture.hpp"

namespace trocar::config {
namespace {

using testing::expect_parts;

class CsvTest : public testing::FileFixture {
 protected:
  Csv read(std::string_view text) const { return Csv::load(write(text), {"x_m,y_m,fx_n", "x_m,y_m,z_m,fx_n"}); }
  void refused(std::string_view text, std::initializer_list<std::string> parts) const {
    expect_parts(error_from([&] { static_cast<void>(read(text)); }), parts);
  }
};

TEST_F(CsvTest, ReadsNumbersAsTheyStand) {
  const Csv csv = read("x_m,y_m,fx_n\n0.1,-2e-3,+4\n1,2,3\n");
  EXPECT_EQ(csv.header(), 0u);
  ASSERT_EQ(csv.rows(), 2u);
  EXPECT_EQ(csv.columns(), 3u);
  EXPECT_EQ(csv(0, 0), 0.1);
  EXPECT_EQ(csv(0, 1), -2e-3);
  EXPECT_EQ(csv(0, 2), 4.0);
  EXPECT_EQ(csv(1, 2), 3.0);
  expect_parts(csv.where(1), {"file.toml:3"});
  EXPECT_EQ(read("x_m,y_m,z_m,fx_n\n1,2,3,4").header(), 1u);
}

TEST_F(CsvTest, TakesWhatSpreadsheetsWrite) {
  const Csv csv = read("\xEF\xBB\xBFx_m, y_m ,fx_n\r\n\r\n 1 ,2,\t3\r\n\n");
  ASSERT_EQ(csv.rows(), 1u);
  EXPECT_EQ(csv(0, 2), 3.0);
  expect_parts(csv.where(0), {"file.toml:3"});
  EXPECT_EQ(read("x_m,y_m,fx_n\n0.1,0.2,12345.678901234567\n")(0, 2), 12345.678901234567);
}

TEST_F(CsvTest, TakesWhatIsMissingWhereItMayBe) {
  refused("x_m,y_m,fx_n\n0.1,nan,4\n", {"file.toml:2: y_m = nan: must be a finite number"});
  const Csv csv = Csv::load(write("x_m\n1\nnan\n"), {"x_m"}, NotANumber::Allowed);
  EXPECT_EQ(csv(0, 0), 1.0);
  EXPECT_TRUE(std::isnan(csv(1, 0)));
  expect_parts(error_from([&] { static_cast<void>(Csv::load(write("x_m\ninf\n"), {"x_m"}, NotANumber::Allowed)); }), {"x_m = inf"});
}

TEST_F(CsvTest, RefusesOtherHeaders) {
  refused("y_m,x_m,fx_n\n1,2,3\n", {"file.toml:1: the header is \"y_m,x_m,fx_n\"; write x_m,y_m,fx_n or x_m,y_m,z_m,fx_n"});
  refused("x_m,y_mm,fx_n\n1,2,3\n", {"file.toml:1: the header is", "in column 2: lengths are in metres: write y_m"});
  refused("x_m;y_m;fx_n\n1;2;3\n", {"not semicolons"});
  refused("1,2,3\n", {"file.toml:1: the header is \"1,2,3\""});
}

TEST_F(CsvTest, NamesLineAndColumnOfABadField) {
  refused("x_m,y_m,fx_n\n1,2,3\n1,2\n", {"file.toml:3: 2 fields, the header has 3"});
  refused("x_m,y_m,fx_n\n1,2,3,\n", {"file.toml:2: 4 fields"});
  refused("x_m,y_m,fx_n\n1,two,3\n", {"file.toml:2: y_m = \"two\": not a number"});
  refused("x_m,y_m,fx_n\n1,,3\n", {"file.toml:2: y_m = \"\": not a number"});
  refused("x_m,y_m,fx_n\n1,2 mm,3\n", {"y_m = \"2 mm\": not a number"});
  refused("x_m,y_m,fx_n\n1,nan,3\n", {"y_m = nan: must be a finite number"});
  refused("x_m,y_m,fx_n\n1,inf,3\n", {"y_m = inf: must be a finite number"});
  refused("x_m,y_m,fx_n\n1,1e999,3\n", {"y_m = 1e999: too large"});
  refused(std::string("x_m,y_m,fx_n\n1,\0,3\n", 19), {"y_m = \"?\": not a number"});
}

TEST_F(CsvTest, NamesFilesThatHoldNoTable) {
  refused("", {"file.toml: is empty; begin with the header line x_m,y_m,fx_n or"});
  refused("x_m,y_m,fx_n\n", {"file.toml: has no rows"});
  refused(std::string(10000, 'x'), {"file.toml:1: the line is too long"});
  expect_parts(error_from([&] { static_cast<void>(Csv::load(folder_ / "none.csv", {"a"})); }), {"none.csv: there is no such file"});
  expect_parts(error_from([&] { static_cast<void>(Csv::load(folder_, {"a"})); }), {"this is a folder"});
}

TEST_F(CsvTest, FailsAtTheLineOfARow) {
  const Csv csv = read("x_m,y_m,fx_n\n\n1,2,3\n");
  expect_parts(error_from([&] { csv.fail(0, "off the mesh; move it"); }), {"file.toml:3: off the mesh; move it"});
}

}  // namespace
}  // namespace trocar::config
