#include "common/config/document.hpp"

#include <sys/stat.h>

#include "common/config/nesting.hpp"
#include "file_fixture.hpp"

namespace trocar::config {
namespace {

using testing::expect_parts;

class DocumentTest : public testing::FileFixture {
 protected:
  template <class Ask>
  std::string error_for(std::string_view text, Ask ask) {
    return error_of(text, [&](const auto& file) {
      const Document document = Document::load(file);
      ask(document.root());
      document.refuse_unknown_keys();
      return 0;
    });
  }
  Table root(std::string_view text) { return Document::load(write(text)).root(); }
};

constexpr Range lengths{0.001, 2.0};

TEST_F(DocumentTest, ReadsEveryKindOfValue) {
  const Table t = root(
      "length_m = 0.25\nwhole = 2\ncount = 7\nname = \"n\"\non = true\npair = [1, 2.5]\nmany = [1.0, 2.0, 3.0]\nboxes = [[0, 1], [2, 3]]\n"
      "axes = [\"x\", \"y\"]\n[inner]\nkind = \"twin\"\n[[entry]]\na = 1\n[[entry]]\na = 2\n");
  EXPECT_EQ(t.number("length_m", lengths, ""), 0.25);
  EXPECT_EQ(t.number("whole", {0, 10}, ""), 2.0);
  EXPECT_EQ(t.integer("count", 0, 10, ""), 7);
  EXPECT_EQ(t.text("name", ""), "n");
  EXPECT_TRUE(t.flag("on"));
  EXPECT_EQ(t.numbers<2>("pair", {0, 10}, ""), (std::array{1.0, 2.5}));
  EXPECT_EQ(t.list("many", {0, 10}, ""), (std::vector{1.0, 2.0, 3.0}));
  EXPECT_EQ(t.rows("boxes", 2, {0, 10}, ""), (std::vector<std::vector<double>>{{0, 1}, {2, 3}}));
  EXPECT_EQ(t.texts("axes", {"x", "y"}), (std::vector<std::string>{"x", "y"}));
  EXPECT_EQ(t.table("inner").one_of("kind", {"twin", "single"}), "twin");
  ASSERT_EQ(t.tables("entry").size(), 2u);
  EXPECT_EQ(t.tables("entry")[1].integer("a", 0, 9, ""), 2);
  EXPECT_EQ(t.where("count"), (folder_ / "file.toml").string() + ":3");
}

TEST_F(DocumentTest, FallsBackOnlyWhenTheKeyIsAbsent) {
  const Table t = root("present = 1.5\n");
  EXPECT_EQ(t.number_or("present", 9.0, {0, 10}, ""), 1.5);
  EXPECT_EQ(t.number_or("absent", 9.0, {0, 10}, ""), 9.0);
  EXPECT_EQ(t.integer_or("absent", 3, 0, 10, ""), 3);
  EXPECT_EQ(t.text_or("absent", "x"), "x");
  EXPECT_TRUE(t.flag_or("absent", true));
  EXPECT_EQ(t.one_of_or("absent", "b", {"a", "b"}), "b");
  EXPECT_EQ(t.numbers_or<2>("absent", {1, 2}, {0, 10}, ""), (std::array{1.0, 2.0}));
  EXPECT_FALSE(t.optional_table("absent").has_value());
  EXPECT_TRUE(t.tables("absent").empty());
  expect_parts(error_from([&] { static_cast<void>(t.number_or("present", 9.0, {2, 10}, "raise it")); }), {":1: present = 1.5", "raise it"});
}

TEST_F(DocumentTest, TableOutlivesItsDocument) { EXPECT_EQ(root("[a.b]\nc = 4\n").table("a").table("b").integer("c", 0, 9, ""), 4); }

TEST_F(DocumentTest, NamesAMissingFileAndWhatElseCannotBeRead) {
  expect_parts(error_from([&] { Document::load(folder_ / "none.toml"); }), {"none.toml: there is no such file", "check the path"});
  expect_parts(error_from([&] { Document::load(folder_); }), {"this is a folder", "name a TOML file"});
  const auto fifo = folder_ / "pipe";
  ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
  expect_parts(error_from([&] { Document::load(fifo); }), {"pipe: not a regular file"});
  expect_parts(error_from([&] { Document::load(write("") / "below.toml"); }), {"below.toml"});
  if (::geteuid() != 0) {  // root reads everything
    const auto file = write("a = 1\n");
    std::filesystem::permissions(file, std::filesystem::perms::none);
    expect_parts(error_from([&] { Document::load(file); }), {"file.toml: cannot be opened", "permissions"});
  }
}

TEST_F(DocumentTest, PointsAtTheLineAndColumnOfMalformedToml) {
  expect_parts(error_for("a = 1\nb = = 2\n", [](const Table&) {}), {"file.toml:2:5: not valid TOML", "correct this line"});
  expect_parts(error_for("a = 1\na = 2\n", [](const Table&) {}), {"file.toml:2:", "not valid TOML"});
  expect_parts(error_for(std::string_view("a = \"\0\xff\"\n", 9), [](const Table&) {}), {"file.toml:1:", "not valid TOML"});
}

TEST_F(DocumentTest, RefusesTheWrongTypeWithValueAndRemedy) {
  const auto number = [](const Table& t) { t.number("base_m", lengths, "such as 0.08"); };
  expect_parts(error_for("\nbase_m = \"0.08\"\n", number), {"file.toml:2: base_m = \"0.08\": expected a number, got a text; such as 0.08"});
  expect_parts(error_for("base_m = true\n", number), {"file.toml:1: base_m = true: expected a number"});
  expect_parts(error_for("base_m = [1, 2]\n", number), {"base_m = [1, 2]: expected a number, got an array of 2"});
  expect_parts(error_for("[base_m]\nx = 1\n", number), {"file.toml:1: base_m: expected a number, got a table"});
  expect_parts(error_for("base_m = 2020-01-01\n", number), {"a date or time: expected a number"});
  expect_parts(error_for("n = 4.0\n", [](const Table& t) { t.integer("n", 0, 9, "write 4"); }),
               {"n = 4: expected a whole number", "write 4"});
  expect_parts(error_for("n = \"4\"\n", [](const Table& t) { t.integer("n", 0, 9, ""); }),
               {"n = \"4\": expected a whole number, got a text"});
  expect_parts(error_for("s = 4\n", [](const Table& t) { t.text("s", "a name"); }),
               {"s = 4: expected a text in quotes, got a number; a name"});
  expect_parts(error_for("s = \"\"\n", [](const Table& t) { t.text("s", "a name"); }), {"s = \"\": must not be empty; a name"});
  expect_parts(error_for("f = \"true\"\n", [](const Table& t) { t.flag("f"); }), {"f = \"true\": expected true or false"});
  expect_parts(error_for("t = 4\n", [](const Table& t) { t.table("t"); }), {"t = 4: expected a table", "write [t]"});
  expect_parts(error_for("t = 4\n", [](const Table& t) { t.tables("t"); }), {"t = 4: expected an array of tables", "write [[t]]"});
}

TEST_F(DocumentTest, RefusesNumbersThatAreNotFiniteOrOutOfRange) {
  const auto number = [](const Table& t) { t.number("base_m", lengths, "such as 0.08"); };
  expect_parts(error_for("base_m = nan\n", number), {"base_m = nan: must be a finite number; such as 0.08"});
  expect_parts(error_for("base_m = -inf\n", number), {"base_m = -inf: must be a finite number"});
  expect_parts(error_for("base_m = 1e999\n", number), {"file.toml:1"});
  expect_parts(error_for("base_m = -0.08\n", number), {"base_m = -0.08: must be from 0.001 to 2; such as 0.08"});
  expect_parts(error_for("n = 10\n", [](const Table& t) { t.integer("n", 0, 9, "fewer"); }), {"n = 10: must be from 0 to 9; fewer"});
  EXPECT_EQ(error_for("base_m = 2.0\n", number), "(nothing was refused)");
  EXPECT_EQ(error_for("base_m = 0.001\n", number), "(nothing was refused)");
}

TEST_F(DocumentTest, OffersTheValueInTheRightUnitWhenItIsOutOfRange) {
  const auto number = [](const Table& t) { t.number("base_m", lengths, "such as 0.08"); };
  expect_parts(error_for("base_m = 85\n", number),
               {"base_m = 85: must be from 0.001 to 2; lengths are in metres; if that is 85 mm, write 0.085"});
  expect_parts(error_for("young_pa = 25.3\n",
                         [](const Table& t) {
                           t.number("young_pa", {1e3, 1e6}, "");
                         }),
               {"if that is 25.3 kPa, write 25300"});
  expect_parts(error_for("angle_rad = 90\n",
                         [](const Table& t) {
                           t.number("angle_rad", {-7, 7}, "");
                         }),
               {"angles are in radians; if that is 90 deg, write 1.570796327"});
  const std::string rate = error_for("counts_per_n = -1\n", [](const Table& t) { t.number("counts_per_n", {1, 9}, ""); });
  EXPECT_EQ(rate.find("forces"), std::string::npos) << rate;
}

TEST_F(DocumentTest, NamesAMissingKeyItsTableAndAnExample) {
  expect_parts(
      error_for("a = 1\n\n[linkage]\nx = 1\n", [](const Table& t) { t.table("linkage").number("base_m", lengths, "between the axes"); }),
      {"file.toml:3: linkage.base_m: missing in [linkage]; add a line such as base_m = 1 (between the axes)"});
  expect_parts(error_for("", [](const Table& t) { t.number("top_m", {0.001, 0.5}, "x"); }), {"file.toml: top_m: missing", "top_m = 0.1"});
  expect_parts(error_for("", [](const Table& t) { t.numbers<2>("pair_m", lengths, "x"); }), {"pair_m = [1, 1]"});
  expect_parts(error_for("", [](const Table& t) { t.one_of("kind", {"twin", "single"}); }), {"kind = \"twin\"", "\"twin\", \"single\""});
  expect_parts(error_for("", [](const Table& t) { t.table("linkage"); }), {"file.toml: linkage: missing; add the table [linkage]"});
  expect_parts(error_for("[a]\n", [](const Table& t) { t.table("a").table("b"); }), {"file.toml:1: a.b: missing; add the table [a.b]"});
}

TEST_F(DocumentTest, ExplainsAMissingKeyByTheOneThatStandsThereInAnotherUnit) {
  const auto number = [](const Table& t) { t.table("linkage").number("base_m", lengths, "x"); };
  expect_parts(error_for("[linkage]\nbase_mm = 85.0\n", number),
               {"file.toml:2: linkage.base_mm = 85: unknown key; lengths are in metres: write base_m = 0.085 for 85 mm"});
  expect_parts(error_for("[linkage]\nbase = 0.085\n", number), {"file.toml:2: linkage.base", "lengths are in metres: write base_m"});
  expect_parts(error_for("[linkage]\nbsae_m = 0.085\n", number),
               {"file.toml:1: linkage.base_m: missing", "Line 2 has bsae_m: was base_m meant?"});
}

TEST_F(DocumentTest, RefusesTheFirstKeyThatNobodyAskedFor) {
  const auto ask = [](const Table& t) {
    t.number_or("base_m", 1, lengths, "");
    t.number_or("tick_us", 1, {0, 1e6}, "");
    if (const auto inner = t.optional_table("inner")) inner->number_or("depth_m", 1, lengths, "");
    for (const Table& entry : t.tables("entry")) entry.number_or("a", 1, {0, 9}, "");
  };
  EXPECT_EQ(error_for("base_m = 1\n[inner]\ndepth_m = 1\n[[entry]]\na = 1\n", ask), "(nothing was refused)");
  expect_parts(error_for("zz = 1\nbsae_m = 1\n", ask),
               {"file.toml:1: zz = 1: unknown key; remove it; known here: base_m, entry, inner, tick_us"});
  expect_parts(error_for("\nbsae_m = 1\n", ask), {"file.toml:2: bsae_m = 1: unknown key; did you mean base_m?"});
  expect_parts(error_for("base_mm = 85\n", ask), {"base_mm = 85: unknown key; lengths are in metres: write base_m = 0.085 for 85 mm"});
  expect_parts(error_for("tick_ms = 0.5\n", ask), {"times are in microseconds: write tick_us = 500 for 0.5 ms"});
  expect_parts(error_for("[inner]\ndepth_cm = [1, 2]\n", ask),
               {"file.toml:2: inner.depth_cm = [1, 2]", "write depth_m = [0.01, 0.02] for [1, 2] cm"});
  expect_parts(error_for("[[entry]]\na = 1\n[[entry]]\nb = 1\n", ask), {"file.toml:4: entry.b = 1: unknown key"});
  expect_parts(error_for("[iner]\ndepth_m = 1\n", ask), {"file.toml:1: iner: unknown key; did you mean inner?"});
  expect_parts(error_for("[unrelated]\nx = 1\n", ask), {"file.toml:1: unrelated: unknown key; remove it"});
}

TEST_F(DocumentTest, RefusesArraysOfTheWrongLengthOrContent) {
  const auto pair = [](const Table& t) { t.numbers<2>("p_m", lengths, "[left, right]"); };
  expect_parts(error_for("p_m = [1, 1, 1]\n", pair), {"p_m = [1, 1, 1]: expected an array of 2 numbers, got 3; [left, right]"});
  expect_parts(error_for("p_m = []\n", pair), {"p_m = []: expected an array of 2 numbers, got an array of 0"});
  expect_parts(error_for("p_m = 1\n", pair), {"p_m = 1: expected an array of 2 numbers, got a number; [left, right]"});
  expect_parts(error_for("p_m = [1, \"x\"]\n", pair), {"p_m = [1, \"x\"]", "found \"x\" among them"});
  expect_parts(error_for("p_m = [1, nan]\n", pair), {"p_m = [1, nan]: must be a finite number"});
  expect_parts(error_for("p_m = [1, 85]\n", pair), {"must be from 0.001 to 2", "if that is 85 mm, write 0.085"});
  expect_parts(error_for("n = [1, 2.5]\n", [](const Table& t) { t.integers<2>("n", 0, 9, ""); }),
               {"n = [1, 2.5]: expected a whole number"});
  expect_parts(error_for("b = [[1, 2], [3]]\n",
                         [](const Table& t) {
                           t.rows("b", 2, {0, 9}, "corners");
                         }),
               {"found [3] among them; corners"});
  expect_parts(error_for("a = [\"x\", \"z\"]\n",
                         [](const Table& t) {
                           t.texts("a", {"x", "y"});
                         }),
               {"\"z\" is not known here; choose from \"x\", \"y\""});
}

TEST_F(DocumentTest, SuggestsTheNearestAllowedWord) {
  expect_parts(error_for("kind = \"twins\"\n",
                         [](const Table& t) {
                           t.one_of("kind", {"twin", "single"});
                         }),
               {"file.toml:1: kind = \"twins\": not known here, did you mean \"twin\"?; write one of \"twin\", \"single\""});
}

TEST_F(DocumentTest, KeepsHostileTextOutOfMessages) {
  const std::string message =
      error_for("k = \"a\\nb\\u001b[31m" + std::string(5000, 'x') + "\"\n", [](const Table& t) { t.number("k", lengths, ""); });
  EXPECT_LT(message.size(), 400u);
  EXPECT_EQ(message.find('\x1b'), std::string::npos);
  EXPECT_EQ(message.find('\n'), std::string::npos);
}

TEST_F(DocumentTest, BoundsSizeAndNesting) {
  expect_parts(error_for(std::string((1u << 20) + 1, '#'), [](const Table&) {}), {"larger than 1024 KiB"});
  std::string dotted = "x = 1\na";
  for (int i = 0; i < 100000; ++i) dotted += ".a";
  expect_parts(error_for(dotted + " = 1\n", [](const Table&) {}), {"file.toml:2: nested deeper than 16 levels"});
  expect_parts(error_for("a = " + std::string(200000, '['), [](const Table&) {}), {"file.toml:1: nested deeper"});
  std::string braces = "a = ";
  for (int i = 0; i < 50000; ++i) braces += "{b=";
  expect_parts(error_for(braces, [](const Table&) {}), {"file.toml:1: nested deeper"});
}

TEST(NestingTest, IgnoresBracketsAndDotsInTextAndComments) {
  const std::string many(100, '[');
  const std::string dots(100, '.');
  EXPECT_EQ(line_nested_too_deep("a = \"" + many + dots + "\"\nb = '" + many + "\\'\nc = 1 # " + many + dots + "\n"), 0u);
  EXPECT_EQ(line_nested_too_deep("a = \"\"\"\n" + many + "\" \"\" \\\"\"\" still text " + many + "\"\"\"\"\"\n"), 0u);
  EXPECT_EQ(line_nested_too_deep("a = '''\n" + many + "'' " + many + "'''\nb = 1"), 0u);
  EXPECT_EQ(line_nested_too_deep("a = \"\\\"" + many + "\"\n"), 0u);
  EXPECT_EQ(line_nested_too_deep("a = '''\n\n'''\nb = " + many), 4u);
  EXPECT_EQ(line_nested_too_deep("a = \"\"\nb = " + many), 2u);
  EXPECT_EQ(line_nested_too_deep("a = \"unterminated\nb = " + many), 2u);
  EXPECT_EQ(line_nested_too_deep("list = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]\n"),
            0u);
}

TEST(NestingTest, AllowsExactlyTheLimit) {
  EXPECT_EQ(line_nested_too_deep("a = " + std::string(nesting_limit, '[')), 0u);
  EXPECT_EQ(line_nested_too_deep("a = " + std::string(nesting_limit + 1, '[')), 1u);
}

}  // namespace
}  // namespace trocar::config
