#include "firmware/flight/folder.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/resource.h>

#include <fstream>
#include <set>
#include <sstream>
#include <string>

#include "common/capture/samples_csv.hpp"

namespace trocar::flight {
namespace {

using Clock = std::chrono::system_clock;

struct FlightFolderTest : ::testing::Test {
  FlightFolderTest() {
    std::string name = (std::filesystem::temp_directory_path() / "trocar_flight_XXXXXX").string();
    base = mkdtemp(name.data());
  }
  ~FlightFolderTest() override { std::filesystem::remove_all(base); }
  [[nodiscard]] std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& e : std::filesystem::directory_iterator(base / "flight")) names.insert(e.path().filename().string());
    return names;
  }
  std::string error_of(const Folder& folder) const {
    try {
      (void)folder.write(recording(), {});
    } catch (const capture::CaptureError& e) {
      return e.what();
    }
    return {};
  }
  static Recording recording(std::size_t samples = 3) {
    Recording r{Fault::FeedbackLost, 7, std::vector<Sample>(samples)};
    for (std::size_t i = 0; i < samples; ++i) r.samples[i].tick = 5 + i;
    return r;
  }

  std::filesystem::path base;
};

TEST_F(FlightFolderTest, WritesTheTableUnderTimeAndFault) {
  const Clock::time_point at{std::chrono::milliseconds(1'700'000'000'042)};
  const auto file = Folder(base / "flight").write(recording(), at);
  EXPECT_EQ(file, base / "flight/flight_20231114T221320.042Z_FeedbackLost.csv");
  std::string expected = std::string(capture::samples_csv_header()) + "\n";
  for (const Sample& s : recording().samples) capture::append_samples_csv(expected, s);
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  EXPECT_EQ(text.str(), expected);
  EXPECT_EQ(files().size(), 1u);
}

TEST_F(FlightFolderTest, KeepsTheNewestAndNothingElseIsTouched) {
  const Folder folder(base / "flight");
  std::filesystem::create_directory(base / "flight");
  std::ofstream(base / "flight/notes.csv") << "mine";
  std::ofstream(base / "flight/flight_x.csv.1.part") << "of a program that was killed";
  std::filesystem::last_write_time(base / "flight/flight_x.csv.1.part",
                                   std::filesystem::file_time_type::clock::now() - std::chrono::minutes(2));
  std::ofstream(base / "flight/flight_y.csv.2.part") << "of one that writes just now";
  for (std::size_t i = 0; i < kept_files + 5; ++i) folder.write(recording(), Clock::time_point{std::chrono::hours(i)});
  const auto names = files();
  EXPECT_EQ(names.size(), kept_files + 2);
  EXPECT_TRUE(names.contains("notes.csv"));
  EXPECT_TRUE(names.contains("flight_y.csv.2.part"));
  EXPECT_FALSE(names.contains("flight_19700101T040000.000Z_FeedbackLost.csv"));
  EXPECT_TRUE(names.contains("flight_19700101T050000.000Z_FeedbackLost.csv"));
  EXPECT_TRUE(names.contains("flight_19700102T000000.000Z_FeedbackLost.csv"));
}

TEST_F(FlightFolderTest, SaysWhyItCannotBeWritten) {
  std::ofstream(base / "file") << "x";
  const std::string text = error_of(Folder(base / "file"));
  EXPECT_NE(text.find((base / "file").string()), std::string::npos) << text;
  EXPECT_NE(text.find("choose"), std::string::npos) << text;
}

TEST_F(FlightFolderTest, AFullDiskLeavesNothingHalfWritten) {
  const Folder folder(base / "flight");
  folder.write(recording(), Clock::time_point{std::chrono::hours(1)});
  ASSERT_NE(signal(SIGXFSZ, SIG_IGN), SIG_ERR);
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit small{1000, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const std::string text = error_of(folder);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  EXPECT_NE(text.find("File too large"), std::string::npos) << text;
  EXPECT_EQ(files(), (std::set<std::string>{"flight_19700101T010000.000Z_FeedbackLost.csv"}));
}

}  // namespace
}  // namespace trocar::flight
