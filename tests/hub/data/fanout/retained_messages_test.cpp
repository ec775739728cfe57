#include "hub/data/fanout/retained_messages.hpp"

#include <gtest/gtest.h>

#include <map>
#include <random>

#include "tests/hub/data/support/route_rig.hpp"
#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::Kind;
using testing::FakeNode;
using testing::HubRig;

using Texts = std::vector<std::string>;

/// A retained group of a provider on shard 0, and subscribers that come late.
class RetainedMessagesTest : public ::testing::Test {
 protected:
  static Limits limits() {
    Limits limits;
    limits.retained_message_bytes = 100'000;
    return limits;
  }
  void SetUp() override { rig.publish_paced_group(1, provider.id, {}, true); }

  void publish(const std::string& text) {
    rig.send(provider, HubRig::group(1), text, {.kind = Kind::group});
    rig.turn();
  }
  void publish_fragment(std::uint32_t number, std::uint32_t offset, std::uint32_t total,
                        const std::string& text) {
    std::string all(proto::kFragmentHeaderSize, '\0');
    proto::store_fragment_header(reinterpret_cast<std::byte*>(all.data()), {number, offset, total});
    rig.send(provider, HubRig::group(1), all + text,
             {.kind = Kind::group, .flags = proto::kFlagFragment});
    rig.turn();
  }
  FakeNode& subscriber(std::size_t shard, const PaceTerms& terms = {}) {
    return subscriber_of(provider, shard, terms);
  }
  FakeNode& subscriber_of(const FakeNode& provides, std::size_t shard,
                          const PaceTerms& terms = {}) {
    FakeNode& node = rig.join(shard);
    members.push_back(&node);
    rig.publish_paced_group(1, provides.id, members, true);
    rig.pace(node, 1, terms, true);
    return node;
  }
  Texts got(FakeNode& node) {
    rig.settle();
    Texts texts;
    for (const auto& frame : node.frames) {
      const std::size_t skip =
          frame.header.has(proto::kFlagFragment) ? proto::kFragmentHeaderSize : 0;
      texts.push_back(frame.text().substr(skip));
    }
    node.frames.clear();
    return texts;
  }

  HubRig rig{2, limits()};
  FakeNode& provider = rig.join(0);
  std::vector<FakeNode*> members;
};

TEST_F(RetainedMessagesTest, ALateSubscriberGetsTheLastFirst) {
  publish("one");
  publish("two");
  FakeNode& here = subscriber(0);
  FakeNode& there = subscriber(1);
  rig.settle();
  publish("three");
  EXPECT_EQ(got(here), (Texts{"two", "three"}));
  EXPECT_EQ(got(there), (Texts{"two", "three"}));
}

TEST_F(RetainedMessagesTest, OnlyTheLastOfABurst) {
  const auto one = HubRig::frame(provider, HubRig::group(1), "one", {.kind = Kind::group});
  auto burst = one;
  const auto two = HubRig::frame(provider, HubRig::group(1), "two", {.kind = Kind::group});
  burst.insert(burst.end(), two.begin(), two.end());
  rig.write(provider, burst);
  rig.turn();
  EXPECT_EQ(got(subscriber(1)), Texts{"two"});
}

TEST_F(RetainedMessagesTest, NoneThereIsNoneGiven) {
  FakeNode& node = subscriber(1);
  EXPECT_EQ(got(node), Texts{});
  publish("one");
  EXPECT_EQ(got(node), Texts{"one"});
}

TEST_F(RetainedMessagesTest, NeverOneThatWasUnderWayBefore) {
  FakeNode& early = subscriber(1);
  EXPECT_EQ(got(early), Texts{});
  // "one" waits in the other shard's mailbox when the late one is published and its shard has not
  // heard of it.
  rig.send(provider, HubRig::group(1), "one", {.kind = Kind::group});
  rig.turn_shard(0);
  FakeNode& late = subscriber(1);
  EXPECT_EQ(got(late), Texts{"one"}) << "once";
  EXPECT_EQ(got(early), Texts{"one"});
}

TEST_F(RetainedMessagesTest, ASubscriberInTheMiddleOfAMessageGetsAllOfIt) {
  publish("last");
  publish_fragment(5, 0, 6, "ab");
  publish_fragment(5, 2, 6, "cd");
  FakeNode& node = subscriber(1);
  rig.settle();
  publish_fragment(5, 4, 6, "ef");
  EXPECT_EQ(got(node), (Texts{"last", "ab", "cd", "ef"}));
  EXPECT_EQ(got(subscriber(0)), (Texts{"ab", "cd", "ef"}));
}

TEST_F(RetainedMessagesTest, AMessageWithoutAnEndIsNotTheLast) {
  publish("last");
  publish_fragment(5, 0, 6, "ab");
  publish_fragment(6, 0, 6, "AB");
  publish_fragment(6, 4, 6, "EF");
  EXPECT_EQ(got(subscriber(0)), Texts{"last"});
}

TEST_F(RetainedMessagesTest, WhatIsTooLargeIsNotKeptNorIsAnOlderOne) {
  publish("old");
  publish_fragment(5, 0, 100'001, std::string(50'000, 'x'));
  publish_fragment(5, 50'000, 100'001, std::string(50'001, 'x'));
  EXPECT_EQ(rig.sum(&ShardCounters::not_retained), 1u);
  EXPECT_EQ(got(subscriber(1)), Texts{});
  publish_fragment(6, 0, 100'000, std::string(50'000, 'x'));
  publish_fragment(6, 50'000, 100'000, std::string(50'000, 'x'));
  EXPECT_EQ(rig.sum(&ShardCounters::not_retained), 1u);
  EXPECT_EQ(got(subscriber(1)).size(), 2u) << "at the limit";
}

// The conductor publishes a new id of the provider, then that the former one is nobody's, then the
// group.
TEST_F(RetainedMessagesTest, IsGivenWhileTheProviderIsRenumbered) {
  publish("1");
  FakeNode& late = subscriber(1);
  rig.nodes().publish(400, {provider.shard, provider.session.slot, provider.session.generation});
  rig.nodes().publish(index_of(provider.id), NodePlace::renumbered());
  EXPECT_EQ(got(late), (Texts{"1"}));
}

TEST_F(RetainedMessagesTest, AStartUnderWayIsNotTakenForALaterSubscriptions) {
  FakeNode& node = rig.join(1);
  publish("1");
  members.push_back(&node);
  rig.publish_paced_group(1, provider.id, members, true);
  rig.pace(node, 1, {}, true);
  rig.command(1, EndPaceCommand{node.session, GroupId{HubRig::group(1)}});
  rig.pace(node, 1, {}, true);
  rig.turn_shard(1);
  EXPECT_EQ(got(node), (Texts{"1"}));
}

// A shard that is late finds both groups in its mailbox, and was told of both before.
TEST_F(RetainedMessagesTest, AStartUnderWayIsNotTakenForALaterGroupsOfThatId) {
  publish("of the former group");
  FakeNode& node = subscriber(1);
  rig.turn_shard(1);
  rig.turn_shard(0);
  rig.withdraw_group(1);
  rig.command(0, ForgetRetainedCommand{GroupId{HubRig::group(1)}, provider.id});
  rig.command(1, EndPaceCommand{node.session, GroupId{HubRig::group(1)}});
  rig.publish_paced_group(1, provider.id, members, true);
  rig.pace(node, 1, {}, true);
  rig.send(provider, HubRig::group(1), "new", {.kind = Kind::group});
  rig.turn_shard(0);
  EXPECT_EQ(got(node), (Texts{"new"}));
}

// The new provider lives on the same shard or on another one, and has said something or nothing.
TEST_F(RetainedMessagesTest, AStartIsAskedForAgainWhereTheProviderChangedMeanwhile) {
  publish("of the former provider");
  for (const std::size_t shard : {0u, 1u}) {
    FakeNode& next = rig.join(shard);
    FakeNode& node = subscriber(1);
    rig.turn_shard(1);  // asks the former provider's shard
    rig.turn_shard(0);
    rig.publish_paced_group(1, next.id, members, true);
    EXPECT_EQ(got(node), Texts{}) << "the next provider has said nothing";
    rig.command(0, ForgetRetainedCommand{GroupId{HubRig::group(1)}, provider.id});
    rig.send(next, HubRig::group(1), "next", {.kind = Kind::group});
    EXPECT_EQ(got(node), Texts{"next"});
    FakeNode& late = subscriber_of(next, 0);
    EXPECT_EQ(got(late), Texts{"next"}) << "the former one's shard forgot its own message only";
    rig.publish_paced_group(1, provider.id, members, true);
    publish("of the former provider");
  }
}

TEST_F(RetainedMessagesTest, ASubscriptionIsOpenAtOnceWhereNobodyProvides) {
  publish("last");
  rig.publish_paced_group(1, NodeId{}, members, true);
  FakeNode& node = rig.join(1);
  members.push_back(&node);
  rig.publish_paced_group(1, NodeId{}, members, true);
  rig.pace(node, 1, {}, true);
  EXPECT_EQ(got(node), Texts{});
  rig.publish_paced_group(1, provider.id, members, true);
  publish("next");
  EXPECT_EQ(got(node), Texts{"next"});
}

TEST_F(RetainedMessagesTest, IsFromTheIdThatItsProviderHasNow) {
  publish("last");
  rig.renumber(provider, 400);
  rig.settle();
  rig.publish_paced_group(1, provider.id, members, true);
  FakeNode& late = subscriber(1);
  rig.settle();
  ASSERT_EQ(late.frames.size(), 1u);
  EXPECT_EQ(late.frames[0].text(), "last");
  EXPECT_EQ(late.frames[0].header.src, provider.id.value());
}

TEST_F(RetainedMessagesTest, IsFreedWithItsServiceAndPinsNothing) {
  publish(std::string(5'000, 'x'));
  rig.turn();
  EXPECT_EQ(rig.sum(&ShardCounters::pinned_bytes), 0u) << "it has a budget of its own";
  rig.withdraw_group(1);
  rig.command(0, ForgetRetainedCommand{GroupId{HubRig::group(1)}, provider.id});
  rig.turn();
  EXPECT_EQ(rig.state(0).retained.groups(), 0u);
}

TEST_F(RetainedMessagesTest, CountsAsAWaitingMessageWhileASubscriberReadsNothing) {
  publish(std::string(20'000, 'x'));
  for (const std::size_t shard : {0u, 1u}) {
    FakeNode& slow = rig.join(shard);
    slow.pipe.set_room(0);
    members.push_back(&slow);
    rig.publish_paced_group(1, provider.id, members, true);
    rig.pace(slow, 1, {}, true);
    rig.settle_without_reading();
    EXPECT_GE(rig.sum(&ShardCounters::pinned_bytes), 20'000u) << "shard " << shard;
    slow.pipe.set_room(MemoryPeer::kAll);
    EXPECT_EQ(got(slow), Texts{std::string(20'000, 'x')});
    rig.turn();
    EXPECT_EQ(rig.sum(&ShardCounters::pinned_bytes), 0u) << "shard " << shard;
  }
}

TEST_F(RetainedMessagesTest, LivesThroughItsProvidersGraceTimeAndNotLonger) {
  publish("last");
  provider.pipe.close();
  rig.settle();
  EXPECT_EQ(got(subscriber(1)), Texts{"last"});
  rig.release(provider);
  rig.turn();
  EXPECT_EQ(rig.state(0).retained.groups(), 0u);
}

// Groups begin and end, their providers leave and have other ids, in any order.
TEST(RetainedMessages, KeepsNothingOfAProviderThatLeft) {
  testing::RouteRig rig;
  std::map<std::uint32_t, std::uint32_t> provider_of;
  std::mt19937 random(1);  // NOLINT(cert-msc51-cpp): the same on every run
  const auto below = [&random](std::uint32_t bound) {
    return static_cast<std::uint32_t>(random() % bound);
  };
  const auto node = [](std::uint32_t index) { return make_id<NodeId>(HubId{7}, index); };
  std::uint32_t newest = 20;
  for (int step = 0; step < 5'000; ++step) {
    const std::uint32_t group = 1 + below(40);
    const std::uint32_t provider = newest - below(20);
    switch (below(8)) {
      case 0:
        rig.retained.forget(GroupId{HubRig::group(group)}, node(provider));
        std::erase_if(provider_of, [&](const auto& each) {
          return each.first == group && each.second == provider;
        });
        break;
      case 1:
        rig.retained.forget_provider(node(provider));
        std::erase_if(provider_of, [&](const auto& each) { return each.second == provider; });
        break;
      case 2:
        rig.retained.renumber_provider(node(provider), node(++newest));
        for (auto& [each, of] : provider_of) of = of == provider ? newest : of;
        break;
      default: {
        hub::Run run = rig.make_run(HubRig::group(group), {"last"}, {.kind = Kind::group});
        proto::FrameHeader header = run.header();
        std::uint32_t& of = provider_of.try_emplace(group, provider).first->second;
        if (below(5) == 0) of = provider;
        header.src = node(of).value();
        rig.retained.keep(run, header, run.size);
      }
    }
    ASSERT_EQ(rig.retained.groups(), provider_of.size()) << "step " << step;
  }
  for (std::uint32_t each = 1; each <= newest; ++each) {
    rig.retained.forget_provider(node(each));
    std::erase_if(provider_of, [&](const auto& entry) { return entry.second == each; });
    ASSERT_EQ(rig.retained.groups(), provider_of.size()) << "provider " << each;
  }
  EXPECT_EQ(rig.retained.groups(), 0u);
}

TEST_F(RetainedMessagesTest, AfterABreakWithoutResumeTheLastComesAgain) {
  FakeNode& node = subscriber(1);
  EXPECT_EQ(got(node), Texts{});
  publish("one");
  EXPECT_EQ(got(node), Texts{"one"});
  node.pipe.close();
  rig.settle();
  publish("two");
  publish("three");
  rig.rejoin(node);
  EXPECT_EQ(got(node), Texts{"three"});
  publish("four");
  EXPECT_EQ(got(node), Texts{"four"});
}

// The ledger has it as a copy, made when it was handed to the subscriber's shard, and there it
// ends: once.
TEST_F(RetainedMessagesTest, IsACopyThatIsDroppedWhereTheSubscriberIsGone) {
  publish("one");
  const std::uint64_t dropped =
      rig.dropped(proto::DropReason::no_subscriber);  // nobody had subscribed
  for (const std::size_t shard : {1u, 0u}) {
    FakeNode& node = rig.join(shard);
    const std::uint64_t copies = rig.ledger().copies;
    rig.pace(node, 1, {}, true);
    rig.turn_shard(shard);  // asks the provider's shard
    rig.command(shard, EndPaceCommand{node.session, GroupId{HubRig::group(1)}});
    EXPECT_EQ(got(node), shard == 0 ? Texts{"one"} : Texts{})
        << "on the provider's own shard it waits for nothing";
    EXPECT_EQ(rig.ledger().copies, copies + 1);
  }
  EXPECT_EQ(rig.dropped(proto::DropReason::no_subscriber), dropped + 1);
}

TEST_F(RetainedMessagesTest, CountsInTheWindowAndIsHeldLikeAnyOther) {
  publish("one");
  FakeNode& node = subscriber(1, {.window = 1});
  EXPECT_EQ(got(node), Texts{"one"});
  publish("two");
  publish("three");
  EXPECT_EQ(got(node), Texts{});
  rig.send_flow(node, proto::flow::Credit{GroupId{HubRig::group(1)}, 1});
  EXPECT_EQ(got(node), Texts{"three"});
}

}  // namespace
}  // namespace gimnet::hub
