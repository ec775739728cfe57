#include "hub/control/state/watches.hpp"

#include <gtest/gtest.h>

#include <set>

#include "tests/hub/control/support/watched_hub.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using proto::Status;
using proto::ns::Change;
using proto::ns::ChangeKind;
namespace ns = proto::ns;

class WatchesTest : public ::testing::Test, protected WatchedHub {};

TEST_F(WatchesTest, TellWhatThereIsAndThenWhatChanges) {
  Session& viewer = join("viewer");
  Session& robot = join("hall/robot");
  advertise(robot, "odom");
  ASSERT_EQ(watch(viewer, {.watch = 3}), Status::done);
  EXPECT_EQ(take(viewer), (Texts{"begin", "present viewer", "present hall/robot",
                                 "present hall/robot/odom", "end"}));
  EXPECT_EQ(take(viewer), Texts{});
  const GroupIndex group = advertise(robot, "pose", "x y");
  advertise(robot, "pose", "x y theta");
  end(robot, false);
  Effects effects;
  ASSERT_FALSE(membership.services().withdraw(robot.index, group, now, effects));
  note(effects);
  end(join("late"), true);
  EXPECT_EQ(take(viewer),
            (Texts{"advertised hall/robot/pose", "changed hall/robot/pose", "away hall/robot",
                   "withdrawn hall/robot/pose", "joined late", "left late"}));
}

TEST_F(WatchesTest, KeepNothingBeforeSomebodyWatches) {
  Session& viewer = join("viewer");
  join("hall/robot");
  EXPECT_FALSE(watches.journal().keeps());
  EXPECT_EQ(watches.journal().version(), 2u);
  // A place in the journal that nobody was ever told cannot be gone on from.
  ASSERT_EQ(watch(viewer, {.watch = 1, .epoch = kEpoch, .version = 1}), Status::done);
  EXPECT_TRUE(watches.journal().keeps());
  EXPECT_EQ(take(viewer), (Texts{"begin", "present viewer", "present hall/robot", "end"}));
  join("late");
  EXPECT_EQ(take(viewer), Texts{"joined late"});
}

TEST_F(WatchesTest, TellOnlyWhatThePatternAndTheSubjectsSay) {
  Session& viewer = join("viewer");
  Session& robot = join("hall/robot");
  advertise(robot, "odom");
  join("");
  ASSERT_EQ(watch(viewer, {.watch = 1, .pattern = "hall/*"}), Status::done);
  EXPECT_EQ(take(viewer), (Texts{"begin", "present hall/robot", "end"}));
  ASSERT_EQ(watch(viewer, {.watch = 2, .pattern = "**", .subjects = ns::kWatchServices}),
            Status::done);
  EXPECT_EQ(take(viewer), (Texts{"begin", "present hall/robot/odom", "end"}));
  join("yard/robot");
  advertise(robot, "pose");
  EXPECT_EQ(take(viewer), Texts{"advertised hall/robot/pose"});
}

TEST_F(WatchesTest, TellOfANewNameWhoeverWatchesTheOldOneOrTheNewOne) {
  Session& viewer = join("viewer");
  Session& robot = join("a/robot");
  ASSERT_EQ(watch(viewer, {.watch = 1, .pattern = "a/*"}), Status::done);
  ASSERT_EQ(watch(viewer, {.watch = 2, .pattern = "b/*"}), Status::done);
  take(viewer);
  Effects effects;
  ASSERT_FALSE(membership.rename(robot, "b/robot", now, effects));
  note(effects);
  EXPECT_EQ(take(viewer), (Texts{"renamed b/robot from a/robot", "renamed b/robot from a/robot"}));
}

TEST_F(WatchesTest, FollowEachOtherWithoutAGap) {
  Session& viewer = join("viewer");
  ASSERT_EQ(watch(viewer, {.watch = 1, .pattern = "robot/*"}), Status::done);
  std::uint64_t version = 0;
  for (int round = 0; round < 20; ++round) {
    join("other/" + std::to_string(round));
    join("robot/" + std::to_string(round));
    serve();
    for (; !waiting[viewer.index].empty(); waiting[viewer.index].pop_front()) {
      const ns::WatchEvents& events = waiting[viewer.index].front();
      EXPECT_EQ(events.epoch, kEpoch);
      EXPECT_EQ(events.hub, kHub);
      const bool first = events.changes.front().kind == ChangeKind::begin;
      EXPECT_TRUE(first || events.after == version);
      for (const Change& change : events.changes) EXPECT_LE(change.version, events.version);
      version = events.version;
      watches.taken(viewer.index, {1, 1});
    }
  }
  EXPECT_EQ(version, watches.journal().version());
}

/// The changes tell what is there, whatever came between the pages of the snapshot.
TEST_F(WatchesTest, AreTrueThoughTheWorldChangesBetweenThePages) {
  Session& viewer = join("viewer");
  limits.scan_records = 64;
  std::vector<Session*> robots;
  for (int i = 0; i < 400; ++i) robots.push_back(&join("robot-" + std::to_string(i)));
  for (int i = 0; i < 300; ++i) advertise(*robots[static_cast<std::size_t>(i)], "odom");
  ASSERT_EQ(watch(viewer, {.watch = 1}), Status::done);
  std::set<std::string> known;
  bool complete = false;
  for (int step = 0; !complete; ++step) {
    ASSERT_LT(step, 1'000);
    static_cast<void>(watches.serve(membership, now, [&](NodeIndex, const proto::Payload& payload) {
      const auto events = proto::decode<ns::WatchEvents>(payload);
      ASSERT_TRUE(events);
      for (const Change& change : events->changes) {
        complete |= change.kind == ChangeKind::end;
        const std::string name = change.node      ? change.node->name
                                 : change.service ? change.service->name
                                                  : "";
        if (name.empty()) continue;
        const bool gone = change.kind == ChangeKind::left || change.kind == ChangeKind::withdrawn;
        if (gone) {
          EXPECT_EQ(known.erase(name), 1u) << name << " left, and was never shown";
        } else if (change.kind == ChangeKind::present || change.kind == ChangeKind::joined ||
                   change.kind == ChangeKind::advertised) {
          EXPECT_TRUE(known.insert(name).second) << name << " was shown twice";
        }
      }
    }));
    watches.taken(viewer.index, {1, 1});
    if (!robots.empty()) {
      end(*robots[(static_cast<std::size_t>(step) * 7919) % robots.size()], true);
      robots.erase(robots.begin() + static_cast<std::ptrdiff_t>(
                                        (static_cast<std::size_t>(step) * 7919) % robots.size()));
    }
    advertise(join("new-" + std::to_string(step)), "pose");
  }
  for (const std::string& text : take(viewer)) {
    const std::string name = text.substr(text.find(' ') + 1);
    if (text.starts_with("left") || text.starts_with("withdrawn")) known.erase(name);
    if (text.starts_with("joined") || text.starts_with("advertised")) known.insert(name);
  }
  std::set<std::string> expected;
  for (const auto& [index, session] : membership.sessions().all())
    expected.insert(session.name.str());
  for (const auto& [group, topic] : membership.topics().groups()) {
    if (topic->provided()) expected.insert(std::string{topic->full_name});
  }
  EXPECT_EQ(known, expected);
}

TEST_F(WatchesTest, ASlowWatcherIsSentLittleAndCostsNobodyElse) {
  Session& slow = join("slow");
  Session& fast = join("fast");
  ASSERT_EQ(watch(slow, {.watch = 1}), Status::done);
  ASSERT_EQ(watch(fast, {.watch = 1}), Status::done);
  take(fast);
  for (int i = 0; i < 1'000; ++i) {
    join("robot-" + std::to_string(i));
    EXPECT_EQ(take(fast), Texts{"joined robot-" + std::to_string(i)});
  }
  EXPECT_EQ(waiting[slow.index].size(), 4u);
  // The events that were kept for it come when it takes.
  const Texts late = take(slow);
  EXPECT_EQ(late.back(), "joined robot-999");
  EXPECT_EQ(watches.resyncs(), 0u);
}

TEST_F(WatchesTest, AtMostAWindowOfOneWatchIsUnderWay) {
  limits.watch_window = 3;
  Session& viewer = join("viewer");
  ASSERT_EQ(watch(viewer, {.watch = 1}), Status::done);
  for (int i = 0; i < 10; ++i) {
    join("robot-" + std::to_string(i));
    serve();
  }
  EXPECT_EQ(waiting[viewer.index].size(), 3u);
  watches.taken(viewer.index, {1, 1});
  serve();
  EXPECT_EQ(waiting[viewer.index].size(), 4u) << "one was taken: one more";
  limits.watch_window = 4;
  serve();
  join("late");
  serve();
  EXPECT_EQ(waiting[viewer.index].size(), 5u) << "and one more with a wider window";
}

TEST_F(WatchesTest, AtMostAWindowOfANodesWatchesIsUnderWay) {
  limits.watch_window_per_node = 3;
  Session& viewer = join("viewer");
  for (const std::uint32_t number : {1u, 2u})
    ASSERT_EQ(watch(viewer, {.watch = number}), Status::done);
  for (int i = 0; i < 10; ++i) {
    join("robot-" + std::to_string(i));
    serve();
  }
  EXPECT_EQ(waiting[viewer.index].size(), 3u) << "each watch alone might have four";
  limits.watch_window_per_node = 4;
  serve();
  EXPECT_EQ(waiting[viewer.index].size(), 4u);
}

TEST_F(WatchesTest, EventsAreAsLargeAsTheLimitSays) {
  const std::string longest(4'096, 'm');
  Session& viewer = join("viewer");
  Session& robot = join("robot");
  for (int i = 0; i < 40; ++i) advertise(robot, "service-" + std::to_string(i), longest);
  std::size_t before = 0;
  for (const std::uint64_t bytes : {8u * 1024, 10u * 1024, 64u * 1024}) {
    limits.watch_event_bytes = bytes;
    ASSERT_EQ(watch(viewer, {.watch = 1}), Status::done);
    std::size_t frames = 0;
    std::size_t most = 0;
    for (serve(); !waiting[viewer.index].empty(); serve()) {
      ++frames;
      most = std::max(most, waiting[viewer.index].front().changes.size());
      waiting[viewer.index].pop_front();
      watches.taken(viewer.index, {1, 1});
    }
    EXPECT_GT(most, before) << bytes;
    EXPECT_GE(frames * most, 40u);
    before = bytes == 8u * 1024 ? most - 1 : most;
  }
  EXPECT_GT(before, 10u) << "of more than 4 KiB each";
}

TEST_F(WatchesTest, NoWatchOfANodeWaitsForAnother) {
  Session& viewer = join("viewer");
  for (std::uint32_t number = 1; number <= 16; ++number)
    ASSERT_EQ(watch(viewer, {.watch = number}), Status::done);
  for (int i = 0; i < 20; ++i) {
    join("robot-" + std::to_string(i));
    serve();
  }
  // One of each, and no more than 12 together beyond that.
  EXPECT_EQ(waiting[viewer.index].size(), 16u);
  std::set<std::uint32_t> told;
  for (const ns::WatchEvents& events : waiting[viewer.index]) told.insert(events.watch);
  EXPECT_EQ(told.size(), 16u);
  for (int i = 0; i < 100; ++i) {
    waiting[viewer.index].clear();
    watches.taken(viewer.index, {7, 1});
    join("late-" + std::to_string(i));
    serve();
    ASSERT_EQ(waiting[viewer.index].size(), 1u);
    EXPECT_EQ(waiting[viewer.index].front().watch, 7u);
  }
}

TEST_F(WatchesTest, WhoIsTooFarBehindBeginsAgain) {
  limits.watch_changes = 100;
  Session& slow = join("slow");
  ASSERT_EQ(watch(slow, {.watch = 1, .pattern = "*"}), Status::done);
  take(slow);
  for (int i = 0; i < 200; ++i) {
    end(join("robot-" + std::to_string(i)), i % 50 != 0);
    serve();
  }
  const Texts told = take(slow);
  const auto again = std::find(told.begin() + 1, told.end(), "begin");
  ASSERT_NE(again, told.end());
  EXPECT_EQ(watches.resyncs(), 1u);
  const Texts rest(again, told.end());
  EXPECT_EQ(std::count(rest.begin(), rest.end(), "end"), 1);
  EXPECT_EQ(std::count(rest.begin(), rest.end(), "present robot-150") +
                std::count(rest.begin(), rest.end(), "joined robot-150"),
            1);
}

TEST_F(WatchesTest, GoOnWhereTheWatcherWasIfTheChangesAreStillThere) {
  Session& viewer = join("viewer");
  ASSERT_EQ(watch(viewer, {.watch = 1}), Status::done);
  take(viewer);
  const std::uint64_t before = watches.journal().version();
  watches.connection_ended(viewer.index);
  join("robot");
  ASSERT_EQ(watch(viewer, {.watch = 1, .epoch = kEpoch, .version = before}), Status::done);
  EXPECT_EQ(take(viewer), Texts{"joined robot"});
  const auto other_life =
      watches.watch(viewer.index, {.watch = 1, .epoch = kEpoch + 1, .version = before});
  EXPECT_TRUE(other_life->snapshot);
  EXPECT_EQ(take(viewer), (Texts{"begin", "present viewer", "present robot", "end"}));
  const auto future =
      watches.watch(viewer.index, {.watch = 1, .epoch = kEpoch, .version = before + 1'000});
  EXPECT_TRUE(future->snapshot);
}

TEST_F(WatchesTest, EndWhenTheyAreToldToAndWithTheConnection) {
  Session& viewer = join("viewer");
  ASSERT_EQ(watch(viewer, {.watch = 1}), Status::done);
  ASSERT_EQ(watch(viewer, {.watch = 2}), Status::done);
  take(viewer);
  EXPECT_FALSE(watches.unwatch(viewer.index, 1));
  EXPECT_EQ(watches.unwatch(viewer.index, 1)->status, Status::not_found);
  EXPECT_EQ(watches.size(), 1u);
  join("robot");
  EXPECT_EQ(take(viewer), Texts{"joined robot"});
  watches.connection_ended(viewer.index);
  EXPECT_EQ(watches.size(), 0u);
  EXPECT_EQ(watches.unwatch(viewer.index, 2)->status, Status::not_found);
  join("robot-2");
  EXPECT_EQ(take(viewer), Texts{});
}

TEST_F(WatchesTest, AreLimited) {
  limits.watches_per_node = 2;
  limits.watches = 3;
  Session& a = join("a");
  Session& b = join("b");
  EXPECT_EQ(watch(a, {.watch = 1}), Status::done);
  EXPECT_EQ(watch(a, {.watch = 2}), Status::done);
  const auto one_more = watches.watch(a.index, {.watch = 3});
  EXPECT_EQ(one_more.error().status, Status::limit);
  EXPECT_NE(one_more.error().sentence.find("watches_per_node"), std::string::npos);
  EXPECT_EQ(watch(a, {.watch = 2}), Status::done) << "the same one anew";
  EXPECT_EQ(watch(b, {.watch = 1}), Status::done);
  EXPECT_EQ(watches.watch(b.index, {.watch = 2}).error().status, Status::limit);
  EXPECT_EQ(watch(b, {.watch = 0}), Status::bad_request);
  EXPECT_EQ(watch(b, {.watch = 1, .pattern = "a//b"}), Status::bad_request);
  EXPECT_EQ(watches.size(), 3u);
}

TEST_F(WatchesTest, OneServingIsABoundedPieceOfWork) {
  limits.scan_records = 64;
  Session& viewer = join("viewer");
  for (int i = 0; i < 1'000; ++i) join("robot-" + std::to_string(i));
  ASSERT_EQ(watch(viewer, {.watch = 1,
                           .pattern = "*"
                                      "/nobody"}),
            Status::done);
  int pieces = 1;
  const auto send = [](NodeIndex, const proto::Payload&) {};
  while (watches.serve(membership, now, send)) ++pieces;
  EXPECT_GE(pieces, 1'000 / 64);
}

TEST_F(WatchesTest, FewThatBeginAsThePatternDoesAreNotLookedForAmongAll) {
  limits.scan_records = 64;
  Session& viewer = join("viewer");
  for (int i = 0; i < 1'000; ++i) join("yard/robot-" + std::to_string(i));
  for (int i = 0; i < 60; ++i) advertise(join("hall/robot-" + std::to_string(i)), "odom");
  std::map<ChangeKind, int> told;
  ASSERT_EQ(watch(viewer, {.watch = 1,
                           .pattern = "hall/"
                                      "**"}),
            Status::done);
  int pieces = 0;
  for (; told[ChangeKind::end] == 0 && pieces < 1'000; ++pieces) {
    static_cast<void>(watches.serve(membership, now, [&](NodeIndex, const proto::Payload& payload) {
      const auto events = proto::decode<ns::WatchEvents>(payload);
      ASSERT_TRUE(events);
      for (const Change& change : events->changes) ++told[change.kind];
    }));
    watches.taken(viewer.index, {1, 4});
  }
  EXPECT_EQ(told[ChangeKind::begin], 1);
  EXPECT_EQ(told[ChangeKind::present], 120);
  EXPECT_EQ(told[ChangeKind::end], 1);
  EXPECT_LT(pieces, 1'000 / 64) << "all nodes would take more";
}

}  // namespace
}  // namespace gimnet::hub
