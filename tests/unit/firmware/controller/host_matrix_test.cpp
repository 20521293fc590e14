// The second part of the fault matrix: what fails on the host's side of the rings, and in the controller's own time. For each row the
// answer, event or fault is named, the reaction is the promised one, and ticks are counted. README.md of firmware/safety shows these rows.
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "common/wire/convert.hpp"
#include "fake_rig.hpp"
#include "firmware/controller/door.hpp"
#include "readme_table.hpp"

namespace trocar::controller {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr std::uint64_t other = 666;
constexpr std::int64_t ms = FakeRig::ms;

enum class Start : std::uint8_t { AtRest, Moving };
enum class Then : std::uint8_t { GoesOn, Holds, QuickStops, TorqueOff };

struct Row {
  const char* what;
  const char* says;  // a reply, an event or a fault by name; empty: nothing is said
  Then then;
  int limit;  // ticks until it is said, at most
  Start start;
  std::function<void(FakeRig&)> begin;
  std::function<void(FakeRig&, int)> each = [](FakeRig&, int) {};  // before each tick, which are counted from 0
};

Command move(double x, double y = 0.15, double speed = 0.05, double stop_force_n = 0.0) {
  return {.session = FakeRig::host,
          .id = 900,
          .kind = CommandKind::Move,
          .target_pose = {x, y, 1.5},
          .speed_m_s = speed,
          .angular_speed_rad_s = 1.0,
          .stop_force_n = stop_force_n};
}

// As it comes through the bridge, age_ns after it was sent.
void arrives(FakeRig& f, const Command& command, std::int64_t age_ns) {
  constexpr std::int64_t sent_ns = 1'000'000'000'000;
  Command taken;
  const ReplyCode code = wire::from_wire(wire::to_wire(command, "", sent_ns, 500), {}, sent_ns + age_ns, taken);
  if (code == ReplyCode::Accepted)
    f.mail->commands.push(taken);
  else
    f.replies.push_back({command.session, command.id, command.kind, code, f.mode(), 0});
}

void fill(FakeRig& f, CommandKind kind, std::size_t room = 0) {
  while (f.mail->commands.size() + room < capacity::command_ring) f.mail->commands.push({.session = other, .id = 1, .kind = kind});
}

// What others send in one tick, through the door that the bridge holds.
void storm(FakeRig& f, CommandKind kind) {
  for (int i = 0; i < 500; ++i) (void)let_in(*f.mail, FakeRig::host, {.session = other, .id = 1, .kind = kind});
}

void silent_for(FakeRig& f, int tick, int ticks) { f.host_talks = tick >= ticks; }

std::vector<Row> rows() {
  std::vector<Row> all;
  const auto command = [&](const char* what, const Command& c, const char* says, Start start = Start::AtRest, Then then = Then::GoesOn) {
    all.push_back({what, says, then, 1, start,
                   [c](FakeRig& f) { (void)(c.kind == CommandKind::Stop ? f.mail->stops.push(c) : f.mail->commands.push(c)); }});
  };
  const auto from_other = [&](const char* what, CommandKind kind, const char* says, Then then = Then::GoesOn) {
    command(what, {.session = other, .id = 1, .kind = kind}, says, Start::Moving, then);
  };
  const auto age = [&](const char* what, std::int64_t age_ns, const char* says) {
    all.push_back({what, says, Then::GoesOn, 1, Start::AtRest, [=](FakeRig& f) { arrives(f, move(0.01), age_ns); }});
  };
  const auto silence = [&](const char* what, int ticks, const char* says, Then then) {
    all.push_back({what, says, then, 81, Start::Moving, [](FakeRig&) {}, [=](FakeRig& f, int tick) { silent_for(f, tick, ticks); }});
  };
  const auto flood = [&](
                         const char* what, CommandKind kind, std::size_t room, const char* says, Then then, int limit,
                         std::function<void(FakeRig&)> begin = [](FakeRig&) {}) {
    all.push_back({what, says, then, limit, Start::Moving, std::move(begin), [=](FakeRig& f, int) { fill(f, kind, room); }});
  };
  const auto clock = [&](const char* what, std::int64_t jump_ns, const char* says, Then then) {
    all.push_back({what, says, then, 1, Start::Moving, [=](FakeRig& f) { f.now_ns += jump_ns; }});
  };
  const auto late = [&](const char* what, std::int64_t late_ns, const char* says, Then then) {
    all.push_back(
        {what, says, then, 1, Start::Moving, [](FakeRig&) {}, [=](FakeRig& f, int tick) { f.late_ns = tick == 0 ? late_ns : 0; }});
  };
  const auto third_stops = [](FakeRig& f) { f.mail->stops.push({.session = 99, .id = 2, .kind = CommandKind::Stop}); };

  command("a Move to NaN", move(nan), "OutOfRange");
  command("a Move at infinite speed", move(0.01, 0.15, infinity), "OutOfRange");
  command("a Move with a NaN for its stop force", move(0.01, 0.15, 0.05, nan), "OutOfRange");
  command("a Move out of the workspace", move(0.0, 0.203), "OutOfRange");
  command("a second Move in motion", move(0.01), "NotAtRest", Start::Moving);
  command("a command of no known kind", {.session = FakeRig::host, .id = 1, .kind = static_cast<CommandKind>(200)}, "WrongVersion",
          Start::Moving);
  age("a command 1 ns before its deadline of 500 ms", 500 * ms - 1, "Accepted");
  age("a command at its deadline", 500 * ms, "Accepted");
  age("a command 1 ns after its deadline", 500 * ms + 1, "Expired");
  from_other("another commander's Arm", CommandKind::Arm, "SessionTaken");
  from_other("another commander's Move", CommandKind::Move, "SessionTaken");
  from_other("another commander's Disarm", CommandKind::Disarm, "SessionTaken");
  from_other("another commander's Hold", CommandKind::Hold, "Done", Then::Holds);
  from_other("another commander's Stop", CommandKind::Stop, "Done", Then::QuickStops);
  silence("the armed host silent for 79 ms", 79, "", Then::GoesOn);
  silence("the armed host silent for 80 ms", 80, "", Then::GoesOn);
  silence("the armed host silent for 81 ms", 81, "HostLost", Then::Holds);
  silence("the armed host gone", std::numeric_limits<int>::max(), "HostLost", Then::Holds);
  flood("keep-alives of others, as many as fit beside the host's", CommandKind::KeepAlive, 1, "", Then::GoesOn, 0);
  flood("a ring full of others' commands: the host's are lost", CommandKind::Home, 0, "HostLost", Then::Holds, 81);
  flood("a Stop while the ring is full of others' commands", CommandKind::Home, 0, "Done", Then::QuickStops, 1, third_stops);
  flood("a Stop while the ring is full of others' Holds", CommandKind::Hold, 0, "Done", Then::QuickStops, 1, third_stops);
  const auto stormed = [&](const char* what, CommandKind kind, const char* says, Then then, int limit,
                           std::function<void(FakeRig&)> begin) {
    all.push_back({what, says, then, limit, Start::Moving, std::move(begin), [=](FakeRig& f, int) { storm(f, kind); }});
  };
  const auto nothing = [](FakeRig&) {};
  const auto third_asks = [](FakeRig& f) {
    storm(f, CommandKind::Home);
    EXPECT_TRUE(let_in(*f.mail, FakeRig::host, {.session = 99, .id = 2, .kind = CommandKind::Stop}));
  };
  const auto third_holds = [](FakeRig& f) {
    storm(f, CommandKind::Home);
    EXPECT_TRUE(let_in(*f.mail, FakeRig::host, {.session = 99, .id = 2, .kind = CommandKind::Hold}));
  };
  stormed("500 commands of others a tick, through the bridge's door", CommandKind::Home, "SessionTaken", Then::GoesOn, 1, nothing);
  stormed("a Hold of a third one among them", CommandKind::Home, "Done", Then::Holds, 9, third_holds);
  stormed("a Stop of a third one among them", CommandKind::Home, "Done", Then::QuickStops, 1, third_asks);
  all.push_back({"a Move that a Stop overtakes", "Stopped", Then::QuickStops, 1, Start::AtRest, [=](FakeRig& f) {
                   f.mail->commands.push(move(0.01));
                   third_stops(f);
                 }});
  clock("the clock 2 ms ahead", 2 * ms, "", Then::GoesOn);
  clock("the clock 2 ms and 1 ns ahead", 2 * ms + 1, "LateTick", Then::QuickStops);
  clock("the clock an hour ahead", 3'600'000 * ms, "LateTick", Then::QuickStops);
  clock("the clock 2 ms back", -2 * ms, "", Then::GoesOn);
  clock("the clock 2 ms and 1 ns back", -2 * ms - 1, "LateTick", Then::QuickStops);
  clock("the clock an hour back", -3'600'000 * ms, "LateTick", Then::QuickStops);
  late("a tick 2 ms late", 2 * ms, "", Then::GoesOn);
  late("a tick 2 ms and 1 ns late", 2 * ms + 1, "LateTick", Then::QuickStops);
  all.push_back({"a NaN out of the control law", "NotFinite", Then::TorqueOff, 1, Start::Moving,
                 [](FakeRig& f) { f.rig.gain_set[0].translation.proportional = nan; }});
  return all;
}

std::string judge(const Row& row) {
  SCOPED_TRACE(row.what);
  FakeRig f;
  row.start == Start::Moving ? f.moving() : f.positioned();
  EXPECT_EQ(f.mode(), Mode::Position);
  EXPECT_EQ(f.sample().moving, row.start == Start::Moving ? 1 : 0);
  f.replies.clear();
  f.events.clear();
  int ticks = 0;
  const auto tick = [&] {
    row.each(f, ticks++);
    f.tick();
  };
  const std::string says = row.says;
  const auto said = [&] {
    for (const Reply& r : f.replies)
      if (says == to_string(r.code)) return true;
    for (const Event& e : f.events)
      if (says == to_string(e.kind)) return true;
    return says == to_string(f.fault());
  };
  row.begin(f);
  std::string answer, until_said, until_safe;
  if (says.empty()) {
    tick();
  } else {
    while ((ticks == 0 || !said()) && ticks < 10 * row.limit) tick();
    EXPECT_TRUE(said());
    EXPECT_LE(ticks, row.limit);
    answer = says;
    until_said = std::to_string(ticks);
  }
  static constexpr const char* names[] = {"goes on", "hold", "quick stop", "torque off"};
  if (row.then == Then::GoesOn) {
    for (int i = 0; i < 3000; ++i) tick();
    EXPECT_EQ(f.mode(), Mode::Position) << to_string(f.fault());
    EXPECT_EQ(f.sample().moving, 0);  // and what moved came to its end
    EXPECT_EQ(f.controller->status().session, FakeRig::host);
    EXPECT_EQ(f.out.request, hal::DriveRequest::Enable);
    EXPECT_EQ(f.count(EventKind::HostLost) + f.count(EventKind::FaultLatched), 0u);
  } else {
    const auto is_safe = [&] { return row.then == Then::Holds ? f.mode() == Mode::Hold && f.sample().moving == 0 : f.torque_free(); };
    const auto reaction = static_cast<safety::Reaction>(static_cast<int>(row.then) - 1);
    const auto allowed = static_cast<int>(safety::settle_ticks(reaction, f.rig));
    const int from = ticks;
    while (!is_safe() && ticks - from < 10 * allowed) tick();
    EXPECT_LE(ticks - from, allowed);
    until_safe = std::to_string(ticks - from);
    for (int i = 0; i < 1000; ++i) {
      tick();
      EXPECT_TRUE(is_safe());
    }
    if (row.then == Then::Holds) {
      EXPECT_EQ(f.out.request, hal::DriveRequest::Enable);
    }
    if (f.fault() != Fault::None) {
      EXPECT_EQ(says, to_string(f.fault()));
      EXPECT_EQ(f.send(CommandKind::ResetFault), ReplyCode::Done);
      EXPECT_TRUE(f.torque_free());
    }
  }
  return "| " + std::string(row.what) + " | " + (answer.empty() ? "borne" : answer) + " | " + names[static_cast<std::size_t>(row.then)] +
         " | " + until_said + " | " + until_safe + " |\n";
}

TEST(HostMatrix, EveryRowIsNamedReactsInTimeAndIsShown) {
  std::string table = "| what happens | answer, event or fault | reaction | ticks to it | and to the safe state |\n|---|---|---|---|---|\n";
  for (const Row& row : rows()) table += judge(row);
  trocar::testing::expect_shown("firmware/safety/README.md", "host matrix", table);
}

}  // namespace
}  // namespace trocar::controller
