#include "hub/shard/hub_frames.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::GoodbyeCode;
using proto::Kind;
using ::testing::ElementsAre;
using testing::FakeNode;
using testing::FrameSpec;
using testing::HubRig;
using ::testing::SizeIs;

TEST(HubFrames, ClosesAConnectionThatSpeaksForAnother) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  rig.send(a, b.id.value(), "mine");
  rig.send(a, b.id.value(), "not mine", {.src = b.id.value()});
  rig.send(a, b.id.value(), "after it");
  rig.settle();
  EXPECT_THAT(b.texts(), ElementsAre("mine"));
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(a.goodbye->code, GoodbyeCode::wrong_source);
  EXPECT_EQ(rig.dropped(DropReason::wrong_source), 1u);
  EXPECT_EQ(rig.sum(&ShardCounters::wrong_source), 1u);
  const auto detached = rig.take_detached();
  ASSERT_TRUE(detached);
  EXPECT_EQ(detached->code, GoodbyeCode::wrong_source);
  EXPECT_FALSE(detached->said_by_peer);
}

struct Malformed {
  const char* what;
  FrameSpec spec;
  std::uint32_t dst;
  std::string payload;
};

std::string ids(std::initializer_list<std::uint32_t> values) {
  std::string text(4 * values.size(), '\0');
  std::memcpy(text.data(), std::data(values), text.size());
  return text;
}

std::string fragment(std::uint32_t offset, std::uint32_t total, const std::string& payload) {
  return ids({1, offset, total}) + payload;
}

TEST(HubFrames, AnswersEachMalformedFrameWithGoodbye) {
  const Malformed cases[] = {
      {"reserved flag", {.flags = 0x40}, 1, ""},
      {"reserved flag 2", {.flags = 0x80}, 1, ""},
      {"reserved lane bit", {.lane = 4}, 1, ""},
      {"reserved lane bits", {.lane = 0x80}, 1, ""},
      {"kind 20", {.kind = static_cast<Kind>(20)}, 1, ""},
      {"kind 255", {.kind = static_cast<Kind>(255)}, 1, ""},
      {"a node's REPORT", {.kind = Kind::report}, 1, ""},
      {"a node's ROUTE", {.kind = Kind::route}, 1, ""},
      {"BLOCK on GROUP", {.kind = Kind::group, .flags = 1}, 1, ""},
      {"BLOCK on LIST", {.kind = Kind::list, .flags = 1}, 1, ids({1})},
      {"BLOCK on BROADCAST", {.kind = Kind::broadcast, .flags = 1}, 0xFFFFFFFF, ""},
      {"LATEST without key", {.flags = 3}, 1, ""},
      {"LATEST SERVICE without key", {.kind = Kind::service, .flags = 3}, 1, ""},
      {"key too short", {.flags = 0x20}, 1, "1234567"},
      {"LIST of none", {.kind = Kind::list}, 0, ""},
      {"LIST of 1025", {.kind = Kind::list}, 1025, std::string(4 * 1025, '\0')},
      {"LIST too short", {.kind = Kind::list}, 2, ids({1})},
      {"LIST unsorted", {.kind = Kind::list}, 2, ids({2, 1})},
      {"LIST repeated", {.kind = Kind::list}, 2, ids({2, 2})},
      {"EXT too short", {.flags = 0x10}, 1, "\x01"},
      {"EXT beyond the end", {.flags = 0x10}, 1, std::string("\x05\x00\x00\x02", 4)},
      {"fragment header too short", {.flags = 8}, 1, "12345678901"},
      {"fragment without payload", {.flags = 8}, 1, fragment(0, 10, "")},
      {"fragment over its total", {.flags = 8}, 1, fragment(8, 10, "abc")},
      {"fragment that wraps", {.flags = 8}, 1, fragment(0xFFFFFFFF, 10, "abc")},
      {"FLOW of unknown operation", {.kind = Kind::flow}, 0, std::string(24, '\x63')},
      {"FLOW too short", {.kind = Kind::flow}, 0, "\x01"},
      {"FLOW for somebody else",
       {.kind = Kind::flow},
       1,
       std::string("\x01\0\0\0", 4) + std::string(12, '\0')},
      {"LINK for somebody else", {.kind = Kind::link}, 1, "junk"},
      {"LINK that is no GOODBYE", {.kind = Kind::link}, 0, "junk"},
  };
  for (const Malformed& each : cases) {
    HubRig rig;
    FakeNode& a = rig.join(0);
    FakeNode& b = rig.join(0);
    rig.send(a, b.id.value(), "before");
    rig.send(a, each.dst, each.payload, each.spec);
    rig.send(a, b.id.value(), "after");
    rig.settle();
    ASSERT_TRUE(a.goodbye) << each.what;
    EXPECT_EQ(a.goodbye->code, GoodbyeCode::malformed) << each.what;
    EXPECT_THAT(b.texts(), ElementsAre("before")) << each.what;
    EXPECT_EQ(rig.dropped(DropReason::malformed), 1u) << each.what;
    EXPECT_EQ(rig.sum(&ShardCounters::malformed), 1u) << each.what;
    EXPECT_EQ(rig.ledger().queued, 0u) << each.what;
  }
}

TEST(HubFrames, RefusesHopsFromANode) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  std::vector<std::byte> bytes = HubRig::frame(a, a.id.value(), "x");
  bytes[14] = std::byte{1};
  rig.write(a, bytes);
  rig.settle();
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(a.goodbye->code, GoodbyeCode::malformed);
}

TEST(HubFrames, AnswersPingWithPong) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  rig.send_flow(a, proto::flow::Ping{.sequence = 9, .sent_ns = 1234});
  rig.settle();
  const auto pongs = a.flow_of<proto::flow::Pong>();
  ASSERT_THAT(pongs, SizeIs(1));
  EXPECT_EQ(pongs[0].sequence, 9u);
  EXPECT_EQ(pongs[0].sent_ns, 1234);
  EXPECT_GT(pongs[0].now_ns, 0);
}

TEST(HubFrames, TellsTheConductorOfAGoodbye) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  rig.write(a, HubRig::frame(a, 0,
                             [] {
                               const auto payload =
                                   proto::encode(proto::Goodbye{GoodbyeCode::done, "bye"});
                               return std::string(reinterpret_cast<const char*>(payload.data()),
                                                  payload.size());
                             }(),
                             {.kind = Kind::link, .src = 0}));
  rig.settle();
  const auto detached = rig.take_detached();
  ASSERT_TRUE(detached);
  EXPECT_TRUE(detached->said_by_peer);
  EXPECT_EQ(detached->code, GoodbyeCode::done);
  EXPECT_EQ(detached->sentence, "bye");
  EXPECT_FALSE(a.goodbye) << "nothing follows a GOODBYE";
}

TEST(HubFrames, HandsControlFramesToTheConductor) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  rig.send(a, 0, "request", {.kind = Kind::ns});
  rig.settle();
  auto events = rig.take_events();
  ASSERT_THAT(events, SizeIs(1));
  const auto* event = std::get_if<ControlFrameEvent>(&events[0].what);
  ASSERT_NE(event, nullptr);
  EXPECT_EQ(event->node, a.id);
  EXPECT_EQ(event->attachment, 1u);
  EXPECT_EQ(event->frame.size(), proto::kHeaderSize + 7);
}

TEST(HubFrames, TakesAsManyUnansweredRequestsAsAllowedAndNotOneMore) {
  Limits limits;
  limits.requests = 3;
  HubRig rig(1, limits);
  FakeNode& a = rig.join(0);
  for (int i = 0; i < 3; ++i) rig.send(a, 0, "request", {.kind = Kind::ns});
  rig.settle();
  EXPECT_FALSE(a.goodbye);
  SendControlCommand answer{.session = a.session, .attachment = 1, .frame = {}, .answers = 1};
  answer.frame = HubRig::frame(a, a.id.value(), "answer", {.kind = Kind::ns});
  rig.command(0, std::move(answer));
  rig.send(a, 0, "request", {.kind = Kind::ns});
  rig.settle();
  EXPECT_FALSE(a.goodbye) << "an answer made room for another request";
  rig.send(a, 0, "request", {.kind = Kind::ns});
  rig.settle();
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(a.goodbye->code, GoodbyeCode::too_many_requests);
}

TEST(HubFrames, CountsRequestsUpToTheLargestLimit) {
  Limits limits;
  limits.requests = 65'536;
  HubRig rig(1, limits);
  FakeNode& a = rig.join(0);
  std::vector<std::byte> requests;
  for (int i = 0; i < 1'024; ++i) {
    const auto one = HubRig::frame(a, 0, "request", {.kind = Kind::ns});
    requests.insert(requests.end(), one.begin(), one.end());
  }
  for (int i = 0; i < 64; ++i) rig.write(a, requests);
  rig.settle();
  EXPECT_FALSE(a.goodbye);
  rig.send(a, 0, "one more", {.kind = Kind::ns});
  rig.settle();
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(a.goodbye->code, GoodbyeCode::too_many_requests);
}

TEST(HubFrames, ClosesForCreditsOfNoUseBeyondTheLimit) {
  Limits limits;
  limits.oddities_burst = 3;
  HubRig rig(1, limits);
  FakeNode& a = rig.join(0);
  const auto credit = [&] {
    rig.send_flow(a, proto::flow::Credit{make_id<GroupId>(HubId{7}, 5), 1});
    rig.settle();
  };
  for (int i = 0; i < 3; ++i) credit();
  EXPECT_FALSE(a.goodbye);
  EXPECT_EQ(rig.sum(&ShardCounters::bad_credits), 3u);
  credit();
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(a.goodbye->code, GoodbyeCode::oddities);
  EXPECT_EQ(rig.sum(&ShardCounters::oddities), 1u);
}

TEST(HubFrames, TellsTheConductorOfMissedMessagesOnceASecondForEachSubscription) {
  Limits limits;
  limits.oddities_burst = 1;
  limits.subscriptions_per_node = 2;
  HubRig rig(1, limits);
  FakeNode& a = rig.join(0);
  const proto::flow::Missed missed{make_id<GroupId>(HubId{7}, 5), 12};
  const auto told = [&] {
    rig.send_flow(a, missed);
    rig.settle();
    std::size_t events = 0;
    for (const ShardEvent& event : rig.take_events()) {
      const auto* of = std::get_if<MissedEvent>(&event.what);
      if (of != nullptr && of->node == a.id && of->missed == missed) ++events;
    }
    return events;
  };
  EXPECT_EQ(told(), 1u);
  EXPECT_EQ(told(), 1u);
  EXPECT_EQ(told(), 0u) << "that of a third subscription";
  EXPECT_EQ(rig.sum(&ShardCounters::bad_credits), 1u);
  rig.pass_ms(1'000);
  EXPECT_EQ(told(), 1u);
  EXPECT_EQ(told(), 1u);
  EXPECT_FALSE(a.goodbye);
  EXPECT_EQ(told(), 0u);
  EXPECT_EQ(told(), 0u);
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(a.goodbye->code, GoodbyeCode::oddities);
}

TEST(HubFrames, TakesASkipUpToTheLastCountThatThereIs) {
  HubRig rig;
  FakeNode& a = rig.join(0, {.resume = true});
  const auto skip = [&](std::uint64_t count) {
    rig.send_flow(a, proto::flow::Skip{DropReason::replaced, count});
    rig.settle();
  };
  skip(3);
  skip(proto::flow::kSkipUnknown);
  EXPECT_EQ(rig.sum(&ShardCounters::gap_frames), 3u);
  skip(UINT64_MAX - 1 - 3);
  EXPECT_FALSE(a.goodbye);
  EXPECT_EQ(rig.sum(&ShardCounters::gap_frames), kGapFramesMost);
  // As the hub tells it where the node comes back.
  rig.send_flow(a, proto::flow::Ping{});
  rig.settle();
  ASSERT_THAT(a.flow_of<proto::flow::Confirm>(), SizeIs(1));
  EXPECT_EQ(a.flow_of<proto::flow::Confirm>().front().count, UINT64_MAX - 1);
  skip(1);
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(a.goodbye->code, GoodbyeCode::malformed);
  EXPECT_EQ(rig.dropped(DropReason::malformed), 1u);
  EXPECT_EQ(rig.sum(&ShardCounters::gap_frames), kGapFramesMost);
}

}  // namespace
}  // namespace gimnet::hub
