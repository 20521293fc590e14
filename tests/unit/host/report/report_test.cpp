#include <gtest/gtest.h>
#include <stdlib.h>

#include <fstream>
#include <iterator>
#include <map>
#include <set>

#include "made_up_run.hpp"

namespace {

using namespace trocar;
using namespace trocar::report;

std::string slurp(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::size_t entries(const std::filesystem::path& path) {
  return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(path), {}));
}

// Every text that follows one of `starts`, up to one of the characters `ends`.
std::vector<std::string> between(const std::string& text, std::initializer_list<const char*> starts, const char* ends) {
  std::vector<std::string> all;
  for (const std::string start : starts) {
    for (std::size_t at = 0; (at = text.find(start, at)) != std::string::npos;) {
      at += start.size();
      all.push_back(text.substr(at, text.find_first_of(ends, at) - at));
    }
  }
  return all;
}

class ReportTest : public testing::Test {
 protected:
  ReportTest() {
    std::string name = (std::filesystem::temp_directory_path() / "trocar_report_XXXXXX").string();
    folder_ = mkdtemp(name.data());
  }
  ~ReportTest() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path folder_;
};

TEST_F(ReportTest, PageStandsAloneAndHoldsTheNumbersOfTheRun) {
  auto run = made_up::make();
  run.info.folder = folder_;
  const Summary s = summarise(run.info, run.samples);
  write_report(run.info, s, run.samples);
  const std::string page = slurp(folder_ / "report.html");
  for (const char* text : {"34.00&nbsp;N/m", "42.00&nbsp;N/m", "68&nbsp;N/m", "2.3 to 2.4&nbsp;N", "40&nbsp;µm", "-1.50&nbsp;N", "ubc_twin",
                           "made up &lt;by&gt; a test &amp; nothing else", "thesis dwell"}) {
    EXPECT_NE(page.find(text), std::string::npos) << text;
  }
  // Five figures inside, nothing fetched from outside, no script, no name used twice, and every reference has its target.
  std::size_t figures = 0;
  for (std::size_t at = 0; (at = page.find("<svg", at)) != std::string::npos; ++at) ++figures;
  EXPECT_EQ(figures, 5u);
  for (const char* outside : {"<script", "<link", "<img", "src=", "@import"}) EXPECT_EQ(page.find(outside), std::string::npos) << outside;
  std::set<std::string> names;
  for (const std::string& name : between(page, {" id='", " id=\""}, "'\"")) EXPECT_TRUE(names.insert(name).second) << name;
  const auto references = between(page, {"href='#", "href=\"#", "url(#"}, "'\")");
  for (const std::string& name : references) EXPECT_TRUE(names.contains(name)) << name;
  EXPECT_FALSE(references.empty());
  EXPECT_EQ(entries(folder_ / "figures"), 5u);
  EXPECT_EQ(entries(folder_), 2u) << "no temporary may stay";
}

TEST_F(ReportTest, SaysWhatTheControllersMachineDid) {
  auto run = made_up::make();
  run.info.folder = folder_;
  const Summary s = summarise(run.info, run.samples);
  write_report(run.info, s, run.samples);
  EXPECT_EQ(slurp(folder_ / "report.html").find("Controller ran on"), std::string::npos);
  EXPECT_NE(to_json(run.info, s).find("\"machine\": null"), std::string::npos);
  run.info.machine = Machine{"Linux <6.1>, core 3",
                             false,
                             {.overruns = 11,
                              .minor_faults = 22,
                              .major_faults = 33,
                              .preemptions = 44,
                              .allocations = 55,
                              .armed_page_faults = 66,
                              .armed_allocations = 77}};
  write_report(run.info, s, run.samples);
  const std::string page = slurp(folder_ / "report.html");
  for (const char* text : {"99.99&nbsp;%", "Linux &lt;6.1&gt;, core 3", "only for simulation", "<td>11</td>",
                           "22 minor, 33 major; 66 while armed", "55; 77 while armed", "44 times"})
    EXPECT_NE(page.find(text), std::string::npos) << text;
  const std::string json = to_json(run.info, s);
  for (const char* text : {"\"real_time\": false", "\"overruns\": 11", "\"armed_page_faults\": 66", "\"p99_99\": 1000"})
    EXPECT_NE(json.find(text), std::string::npos) << text << json;
}

TEST_F(ReportTest, SecondReportReplacesTheFirst) {
  auto run = made_up::make();
  run.info.folder = folder_;
  const Summary s = summarise(run.info, run.samples);
  write_report(run.info, s, run.samples);
  const std::string first = slurp(folder_ / "report.html");
  write_report(run.info, s, run.samples);
  EXPECT_EQ(slurp(folder_ / "report.html"), first);
}

TEST_F(ReportTest, LockstepRunHasNoTimesAndNoHistograms) {
  auto run = made_up::make();
  run.info.folder = folder_;
  run.info.lockstep = true;
  write_report(run.info, summarise(run.info, run.samples), run.samples);
  EXPECT_NE(slurp(folder_ / "report.html").find("a virtual clock has none"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "figures/tick_time.svg"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "figures/force_depth.svg"));
}

TEST_F(ReportTest, HapticRunShowsItsDisplaysAndNoInsertions) {
  auto run = made_up::make_haptic();
  run.info.folder = folder_;
  write_report(run.info, summarise(run.info, run.samples), run.samples);
  const std::string page = slurp(folder_ / "report.html");
  for (const char* text : {"A virtual needle in the hand", "impedance", "admittance", "40.0&nbsp;mm", "2.00&nbsp;N", "0.400&nbsp;N",
                           "0.100&nbsp;N", "rise 12&nbsp;ms", "1 of 2000", "-1.00&nbsp;mJ", "hand, true"})
    EXPECT_NE(page.find(text), std::string::npos) << text;
  for (const char* text : {"Needle insertion", "Insertions", "Beside the thesis", "Tracking", "Thesis:"})
    EXPECT_EQ(page.find(text), std::string::npos) << text;
  for (const char* figure : {"felt_time.svg", "felt_depth.svg", "display_energy.svg", "tick_time.svg", "wakeup.svg"})
    EXPECT_TRUE(std::filesystem::exists(folder_ / "figures" / figure)) << figure;
  EXPECT_EQ(entries(folder_ / "figures"), 5u);
}

TEST_F(ReportTest, HapticRunOfARealRigHasNoTruthToShow) {
  auto run = made_up::make_haptic();
  run.info.folder = folder_;
  run.info.truth.clear();
  write_report(run.info, summarise(run.info, run.samples), run.samples);
  const std::string page = slurp(folder_ / "report.html");
  for (const char* text : {"Estimate less true hand", "hand, true", "truth.csv"}) EXPECT_EQ(page.find(text), std::string::npos) << text;
  EXPECT_NE(page.find("hand, estimated"), std::string::npos);
}

TEST_F(ReportTest, HapticRunThatNeverGotThereSaysSo) {
  auto run = made_up::make_haptic();
  run.info.folder = folder_;
  run.info.phases.clear();
  write_report(run.info, summarise(run.info, run.samples), run.samples);
  EXPECT_NE(slurp(folder_ / "report.html").find("ended before the first display"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "figures/felt_time.svg"));
}

TEST_F(ReportTest, EmptyRunStillGetsAPageThatSaysSo) {
  RunInfo info;
  info.folder = folder_;
  write_report(info, summarise(info, {}), {});
  EXPECT_NE(slurp(folder_ / "report.html").find("not measured"), std::string::npos);
}

TEST_F(ReportTest, MissingGnuplotAndUnwritableFolderAreOneSentenceWithARemedy) {
  auto run = made_up::make();
  run.samples.resize(5000);
  run.info.folder = folder_;
  const Summary s = summarise(run.info, run.samples);
  const std::string path = getenv("PATH");
  setenv("PATH", "/nonexistent", 1);
  std::string text;
  try {
    write_report(run.info, s, run.samples);
  } catch (const ReportError& error) {
    text = error.what();
  }
  setenv("PATH", path.c_str(), 1);
  EXPECT_NE(text.find("gnuplot, which is not installed: apt-get install"), std::string::npos) << text;
  EXPECT_EQ(entries(folder_), 0u) << "nothing half-written";

  run.info.folder = folder_ / "missing";
  try {
    write_report(run.info, s, run.samples);
    FAIL() << "no error";
  } catch (const ReportError& error) {
    EXPECT_NE(std::string_view(error.what()).find("missing"), std::string_view::npos) << error.what();
  }
}

TEST(Json, HoldsOnlyWhatTheKindHas) {
  const auto haptic = made_up::make_haptic();
  const std::string felt = to_json(haptic.info, summarise(haptic.info, haptic.samples));
  for (const char* text : {"\"kind\": \"haptic\"", "\"display\": \"impedance\"", "\"unsolved_ticks\": 1", "\"observer_rise_s\": null",
                           "\"observer_rise_s\": 0.012"})
    EXPECT_NE(felt.find(text), std::string::npos) << text << felt;
  EXPECT_EQ(felt.find("\"insertions\""), std::string::npos);
  const auto insertion = made_up::make();
  const std::string inserted = to_json(insertion.info, summarise(insertion.info, insertion.samples));
  EXPECT_NE(inserted.find("\"kind\": \"insertion\""), std::string::npos);
  EXPECT_EQ(inserted.find("\"displays\""), std::string::npos);
}

TEST(Json, HoldsTheNumbersAndNullForWhatWasNotMeasured) {
  auto run = made_up::make();
  run.info.scene = "a \"quoted\"\nname";
  Summary s = summarise(run.info, run.samples);
  s.insertions.resize(1);
  s.insertions[0].fit->slope_n_per_m = 0.1;
  const std::string json = to_json(run.info, s);
  EXPECT_NE(json.find("\"slope_n_per_m\": 0.1,"), std::string::npos) << json;
  EXPECT_NE(json.find("\"step_m\": null"), std::string::npos) << json;
  EXPECT_NE(json.find("\"scene\": \"a \\\"quoted\\\"\\u000aname\""), std::string::npos) << json;
  // Balanced outside of texts, and not a trace of a number that JSON does not have.
  long depth = 0;
  bool in_text = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    if (json[i] == '"' && (i == 0 || json[i - 1] != '\\')) in_text = !in_text;
    if (in_text) continue;
    if (json[i] == '{' || json[i] == '[') ++depth;
    if (json[i] == '}' || json[i] == ']') --depth;
  }
  EXPECT_EQ(depth, 0);
  EXPECT_EQ(json.find("nan"), std::string::npos);
}

}  // namespace
