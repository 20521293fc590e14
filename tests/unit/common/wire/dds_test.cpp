#include <gtest/gtest.h>
#include <unistd.h>

#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "common/wire/convert.hpp"
#include "common/wire/dds.hpp"

namespace {

using namespace trocar;
using namespace std::chrono_literals;

std::uint32_t test_domain() { return 100 + static_cast<std::uint32_t>(getpid()) % 100; }

bool eventually(const std::function<bool()>& condition) {
  const auto deadline = std::chrono::steady_clock::now() + 10s;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(2ms);
  }
  return true;
}

TEST(Dds, CarriesABatchOfSamplesUnchanged) {
  const wire::Participant participant(test_domain());
  wire::Writer<wire::SampleBatch> writer(participant);
  wire::Reader<wire::SampleBatch> reader(participant);
  ASSERT_TRUE(eventually([&] { return writer.matched() == 1 && reader.matched() == 1; }));

  auto buffer = std::make_unique<wire::BatchBuffer>();
  Sample s;
  for (std::uint64_t i = 0; i < wire::BatchBuffer::capacity; ++i) {
    s.tick = 1000 + i;
    s.pose = {0.1, 0.2, 0.3 + static_cast<double>(i)};
    buffer->push(s);
  }
  ASSERT_TRUE(writer.write(buffer->message(3)));

  std::vector<Sample> got;
  std::uint64_t dropped = 0;
  wire::WaitSet wait(participant);
  wait.add(reader.entity());
  while (got.empty()) {
    ASSERT_TRUE(wait.wait(10s));
    reader.take([&](const wire::SampleBatch& batch) {
      dropped = batch.dropped;
      for (std::uint32_t i = 0; i < batch.samples._length; ++i) got.push_back(wire::from_wire(batch.samples._buffer[i]));
    });
  }
  ASSERT_EQ(got.size(), wire::BatchBuffer::capacity);
  EXPECT_EQ(dropped, 3u);
  EXPECT_EQ(got.back().tick, 1099u);
  EXPECT_EQ(got.back().pose[2], 99.3);
  EXPECT_FALSE(wait.wait(0ns));
}

TEST(Dds, TakesNoMoreThanItIsAskedFor) {
  const wire::Participant participant(test_domain());
  wire::Writer<wire::Command> writer(participant);
  wire::Reader<wire::Command> reader(participant);
  ASSERT_TRUE(eventually([&] { return writer.matched() == 1 && reader.matched() == 1; }));
  std::vector<std::uint32_t> ids;
  for (std::uint32_t id = 0; id < 200; ++id) ASSERT_TRUE(writer.write(wire::to_wire(Command{.id = id}, "", 0, 0)));
  ASSERT_TRUE(eventually([&] { return reader.take([&](const wire::Command& c) { ids.push_back(c.id); }, 64) > 0; }));
  EXPECT_LE(ids.size(), 64u);
  ASSERT_TRUE(eventually([&] {
    (void)reader.take([&](const wire::Command& c) { ids.push_back(c.id); });
    return ids.size() == 200;
  }));
  for (std::uint32_t id = 0; id < 200; ++id) EXPECT_EQ(ids[id], id);  // nothing was lost in between
}

TEST(Dds, LateReaderGetsTheLastStatusAndAllEventsButNoOldCommand) {
  const wire::Participant participant(test_domain());
  wire::Writer<wire::Status> status(participant);
  wire::Writer<wire::Event> events(participant);
  wire::Writer<wire::Command> commands(participant);
  wire::Status value{};
  for (std::uint64_t i = 1; i <= 3; ++i) {
    value.tick = i;
    ASSERT_TRUE(status.write(value));
    Event event;
    event.tick = i;
    ASSERT_TRUE(events.write(wire::to_wire(event, "text")));
    Command command;
    command.id = static_cast<std::uint32_t>(i);
    ASSERT_TRUE(commands.write(wire::to_wire(command, "", 0, 0)));
  }

  const wire::Participant late(test_domain());
  wire::Reader<wire::Status> status_reader(late);
  wire::Reader<wire::Event> event_reader(late);
  wire::Reader<wire::Command> command_reader(late);
  std::vector<std::uint64_t> seen_status, seen_events, seen_commands;
  ASSERT_TRUE(eventually([&] {
    status_reader.take([&](const wire::Status& s) { seen_status.push_back(s.tick); });
    event_reader.take([&](const wire::Event& e) { seen_events.push_back(e.tick); });
    return seen_events.size() >= 3 && !seen_status.empty() && commands.matched() == 1;
  }));
  EXPECT_EQ(seen_status, (std::vector<std::uint64_t>{3}));
  EXPECT_EQ(seen_events, (std::vector<std::uint64_t>{1, 2, 3}));
  // A command written now arrives alone: the three of before were not kept for it.
  Command command;
  command.id = 4;
  ASSERT_TRUE(commands.write(wire::to_wire(command, "", 0, 0)));
  ASSERT_TRUE(eventually([&] {
    command_reader.take([&](const wire::Command& c) { seen_commands.push_back(c.id); });
    return !seen_commands.empty();
  }));
  EXPECT_EQ(seen_commands, (std::vector<std::uint64_t>{4}));
}

TEST(Dds, LosesNoCommandWhenManyAreSentAtOnce) {
  const wire::Participant participant(test_domain());
  wire::Writer<wire::Command> writer(participant);
  wire::Reader<wire::Command> reader(participant);
  ASSERT_TRUE(eventually([&] { return writer.matched() == 1 && reader.matched() == 1; }));
  constexpr std::uint32_t count = 500;
  std::uint32_t next = 0;
  bool in_order = true;
  for (std::uint32_t i = 0; i < count; ++i) {
    Command command;
    command.id = i;
    ASSERT_TRUE(writer.write(wire::to_wire(command, "", 0, 0)));
  }
  ASSERT_TRUE(eventually([&] {
    reader.take([&](const wire::Command& c) { in_order = in_order && c.id == next++; });
    return next >= count;
  }));
  EXPECT_EQ(next, count);
  EXPECT_TRUE(in_order);
}

TEST(Dds, SeesItsPeerLeave) {
  const wire::Participant participant(test_domain());
  wire::Reader<wire::Status> reader(participant);
  {
    const wire::Participant other(test_domain());
    wire::Writer<wire::Status> writer(other);
    ASSERT_TRUE(eventually([&] { return reader.matched() == 1; }));
  }
  EXPECT_TRUE(eventually([&] { return reader.matched() == 0; }));
}

TEST(Dds, ThrowingVisitorReturnsWhatItTook) {
  const wire::Participant participant(test_domain());
  wire::Writer<wire::Reply> writer(participant);
  wire::Reader<wire::Reply> reader(participant);
  ASSERT_TRUE(writer.write(wire::to_wire(Reply{})));
  ASSERT_TRUE(eventually([&] {
    try {
      reader.take([](const wire::Reply&) { throw std::runtime_error("stop"); });
      return false;
    } catch (const std::runtime_error&) {
      return true;
    }
  }));
  EXPECT_EQ(reader.take([](const wire::Reply&) {}), 0u);
}

TEST(Dds, RefusesADomainWithoutPorts) {
  try {
    const wire::Participant participant(231);
    FAIL() << "no error";
  } catch (const wire::Error& error) {
    EXPECT_NE(std::string_view(error.what()).find("231"), std::string_view::npos) << error.what();
    EXPECT_NE(std::string_view(error.what()).find("0 … 230"), std::string_view::npos) << error.what();
  }
}

TEST(Topics, EveryTypeOfTheIdlIsFoundAndTheTextIsEmbedded) {
  for (const wire::Topic& topic : wire::topics) {
    EXPECT_STREQ(wire::descriptor_of(topic).m_typename, topic.type);
    const std::string declaration = "struct " + std::string(std::string_view(topic.type).substr(sizeof("trocar::wire::") - 1)) + " {";
    EXPECT_NE(wire::idl_text().find(declaration), std::string_view::npos) << declaration;
  }
}

}  // namespace
