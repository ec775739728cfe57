#include "client/nif/credit_book.hpp"

#include <gtest/gtest.h>

#include <array>
#include <string>
#include <thread>
#include <utility>

#include "proto/control/ns.hpp"
#include "proto/frame/fragment_header.hpp"
#include "tests/client/nif/support/declaring.hpp"

// Through the whole library, with a hub that a test plays: what is credited when.

namespace gimnet::nif {
namespace {

using test::connect_to;
using test::Connected;
using test::FakeConnection;
using test::FakeHub;
using test::make_welcome;

constexpr std::uint32_t kGroup = (7u << 20) | 5;

void answer_subscribe(FakeConnection& hub, std::uint32_t window, std::uint32_t group = kGroup) {
  std::uint16_t number = 0;
  const auto request = hub.next_request<proto::ns::Subscribe>(number);
  ASSERT_TRUE(request);
  proto::ns::SubscribeAnswer answer;
  answer.group = GroupId{group};
  answer.delivery = proto::ns::Delivery::sync;
  answer.window = window;
  answer.number = request->number;
  hub.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
}

void publish(FakeConnection& hub, std::uint32_t group = kGroup) {
  proto::FrameParts parts;
  parts.header.kind = proto::Kind::group;
  parts.header.src = test::kPeerId;
  parts.header.dst = group;
  hub.send(parts, "x");
}

std::uint64_t credited(FakeConnection& hub) {
  const auto credit = hub.next_flow<proto::flow::Credit>();
  EXPECT_TRUE(credit);
  return credit && credit->group == GroupId{kGroup} ? credit->taken : 0;
}

nif_incoming take(nif_node* node, nif_incoming_type type = NIF_MESSAGE) {
  nif_incoming in{};
  do {
    EXPECT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_OK);
    nif_release(&in);
  } while (in.type != type);
  return in;
}

void subscribe(Connected& connected, std::uint32_t window) {
  std::thread asking([&] {
    const nif_pace pace{sizeof pace, window, 0, 0.0};
    nif_subscription got{};
    EXPECT_EQ(nif_subscribe_paced(connected.node.get(), "peer/scan", &pace, &got, NIF_FOREVER),
              NIF_OK);
    EXPECT_EQ(got.window, window);
  });
  answer_subscribe(connected.hub, window);
  asking.join();
}

TEST(CreditBook, CreditsWhatTheProgramTook) {
  FakeHub hub;
  Connected connected = connect_to(hub, test::default_options(), make_welcome());
  subscribe(connected, 1);
  for (std::uint64_t i = 1; i <= 3; ++i) {
    publish(connected.hub);
    EXPECT_NE(take(connected.node.get()).epoch, 0u);
    EXPECT_EQ(credited(connected.hub), i);
  }
}

TEST(CreditBook, GathersWhileMoreWaits) {
  FakeHub hub;
  Connected connected = connect_to(hub, test::default_options(), make_welcome());
  subscribe(connected, 8);
  for (int i = 0; i < 8; ++i) publish(connected.hub);
  std::size_t taken = 0;
  while (taken < 8) {
    nif_incoming in[8];
    std::size_t count = 0;
    ASSERT_EQ(nif_receive_many(connected.node.get(), in, 8, &count, NIF_FOREVER), NIF_OK);
    taken += count;
    for (std::size_t i = 0; i < count; ++i) nif_release(&in[i]);
  }
  std::uint64_t total = 0;
  while (total < 8) {
    const std::uint64_t next = credited(connected.hub);
    ASSERT_GT(next, total) << "totals grow";
    total = next;
  }
  EXPECT_EQ(total, 8u);
}

/// A message comes before the answer to SUBSCRIBE, which has that window.
void subscribe_late(Connected& connected, std::uint32_t window) {
  std::thread asking([&] {
    EXPECT_EQ(nif_subscribe(connected.node.get(), "peer/scan", nullptr, NIF_FOREVER), NIF_OK);
  });
  std::uint16_t number = 0;
  EXPECT_TRUE(connected.hub.next_request<proto::ns::Subscribe>(number));
  publish(connected.hub);
  proto::ns::SubscribeAnswer answer;
  answer.group = GroupId{kGroup};
  answer.window = window;
  connected.hub.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
  asking.join();
}

TEST(CreditBook, CountsFromTheAnswer) {
  FakeHub hub;
  Connected connected = connect_to(hub, test::default_options(), make_welcome());
  for (const std::uint32_t window : {0u, 1u}) {
    subscribe_late(connected, window);
    EXPECT_EQ(take(connected.node.get()).epoch, 0u) << "the hub does not count it either";
    publish(connected.hub);
    EXPECT_EQ(take(connected.node.get()).epoch != 0, window != 0);
  }
  EXPECT_EQ(credited(connected.hub), 1u);
}

TEST(CreditBook, AGroupWithoutAWindowIsNotCredited) {
  FakeHub hub;
  Connected connected = connect_to(hub, test::default_options(), make_welcome());
  subscribe(connected, 0);
  publish(connected.hub);
  EXPECT_EQ(take(connected.node.get()).epoch, 0u);
}

TEST(CreditBook, TheProgramMayCreditByItself) {
  FakeHub hub;
  nif_options options = test::default_options();
  options.credit_by_program = 1;
  Connected connected = connect_to(hub, options, make_welcome());
  subscribe(connected, 2);
  publish(connected.hub);
  const nif_incoming in = take(connected.node.get());
  EXPECT_EQ(nif_credit(connected.node.get(), in.to, in.epoch + 1, 1, 0), NIF_OK) << "another epoch";
  EXPECT_EQ(nif_credit(connected.node.get(), kGroup + 1, in.epoch, 1, 0), NIF_OK)
      << "another group";
  EXPECT_EQ(nif_credit(connected.node.get(), in.to, in.epoch, 1, 0), NIF_OK);
  EXPECT_EQ(credited(connected.hub), 1u);
}

TEST(CreditBook, CreditsAnEndOfWhichNothingCanBeGivenOut) {
  FakeHub hub;
  Connected connected = connect_to(hub, test::default_options(), make_welcome());
  subscribe(connected, 1);
  proto::FrameParts parts;
  parts.header.kind = proto::Kind::group;
  parts.header.src = test::kPeerId;
  parts.header.dst = kGroup;
  parts.fragment = proto::FragmentHeader{9, 2, 4};
  connected.hub.send(parts, "cd");
  EXPECT_EQ(credited(connected.hub), 1u);
}

TEST(CreditBook, ANewSessionBeginsAtZero) {
  FakeHub hub;
  Connected connected = connect_to(hub, test::default_options(), make_welcome());
  subscribe(connected, 2);
  publish(connected.hub);
  static_cast<void>(take(connected.node.get()));
  EXPECT_EQ(credited(connected.hub), 1u);
  connected.hub.close();
  connected.hub = hub.admit(make_welcome());
  answer_subscribe(connected.hub, 2);
  static_cast<void>(take(connected.node.get(), NIF_CONNECTED));
  publish(connected.hub);
  static_cast<void>(take(connected.node.get()));
  EXPECT_EQ(credited(connected.hub), 1u);
}

TEST(CreditBook, AResumedOneRepeatsItsTotals) {
  FakeHub hub;
  proto::Welcome welcome = make_welcome(1 << 20);
  Connected connected = connect_to(hub, test::default_options("robot"), welcome);
  subscribe(connected, 2);
  publish(connected.hub);
  static_cast<void>(take(connected.node.get()));
  EXPECT_EQ(credited(connected.hub), 1u);
  connected.hub.close();
  welcome.resumed = true;
  connected.hub = hub.admit(welcome);
  EXPECT_EQ(credited(connected.hub), 1u);
}

constexpr std::uint32_t kMovedGroup = kGroup + 1;

FakeConnection come_back_resumed(FakeHub& hub) {
  proto::Welcome welcome = make_welcome(1 << 20);
  welcome.resumed = true;
  return hub.admit(welcome);
}

std::uint64_t credited_of(FakeConnection& hub, std::uint32_t group) {
  while (const auto credit = hub.next_flow<proto::flow::Credit>()) {
    if (credit->group == GroupId{group}) return credit->taken;
  }
  return 0;
}

TEST(CreditBook, AChangeOfTheWindowLetsTheCountsGoOnAndAnotherSubscriptionBeginsThemAnew) {
  FakeHub hub;
  Connected connected = connect_to(hub, test::default_options(), make_welcome());
  subscribe(connected, 2);
  const auto take_one = [&] {
    publish(connected.hub);
    static_cast<void>(take(connected.node.get()));
    return *connected.hub.next_flow<proto::flow::Credit>();
  };
  const proto::flow::Credit first = take_one();
  EXPECT_EQ(first.taken, 1u);
  subscribe(connected, 1);
  const proto::flow::Credit second = take_one();
  EXPECT_EQ(second.taken, 2u);
  EXPECT_EQ(second.number, first.number);
  std::thread ending(
      [&] { EXPECT_EQ(nif_unsubscribe(connected.node.get(), "peer/scan", NIF_FOREVER), NIF_OK); });
  test::answer_unsubscribe(connected.hub, true);
  ending.join();
  subscribe(connected, 1);
  const proto::flow::Credit anew = take_one();
  EXPECT_EQ(anew.taken, 1u);
  EXPECT_NE(anew.number, first.number) << "a late CREDIT of the former one must not count";
}

TEST(CreditBook, AGroupWithoutAWindowMayHaveOneAfterABreak) {
  FakeHub hub;
  Connected connected = connect_to(hub, test::default_options("robot"), make_welcome(1 << 20));
  subscribe(connected, 0);
  publish(connected.hub);
  EXPECT_EQ(take(connected.node.get()).epoch, 0u);
  connected.hub.close();
  connected.hub = come_back_resumed(hub);
  answer_subscribe(connected.hub, 1);
  publish(connected.hub);
  static_cast<void>(take(connected.node.get()));
  EXPECT_EQ(credited(connected.hub), 1u);
}

struct Asked {
  std::uint16_t request = 0;
  std::uint8_t number = 0;
};

/// The next request is SUBSCRIBE of `name`; its answer has to wait for its turn.
Asked subscribe_of(FakeConnection& hub, const std::string& name) {
  Asked asked;
  const auto request = hub.next_request<proto::ns::Subscribe>(asked.request);
  EXPECT_TRUE(request && request->name == name);
  if (request) asked.number = request->number;
  return asked;
}

void give(FakeConnection& hub, Asked asked, std::uint32_t group) {
  proto::ns::SubscribeAnswer answer;
  answer.group = GroupId{group};
  answer.window = 1;
  answer.number = asked.number;
  hub.send_control(proto::Kind::ns, proto::encode_answer(answer, asked.request));
}

/// A hub that began anew gives two services other groups, of the same numbers.
void swap_groups(bool first_answers_first, std::uint32_t first_group, std::uint32_t second_group) {
  FakeHub hub;
  Connected connected = connect_to(hub, test::default_options(), make_welcome());
  const std::array<std::pair<const char*, std::uint32_t>, 2> services{
      {{"peer/a", kGroup}, {"peer/b", kMovedGroup}}};
  for (const auto& [name, group] : services) {
    const nif_pace pace{sizeof pace, 1, 0, 0.0};
    std::thread asking([&, asked = name] {
      EXPECT_EQ(nif_subscribe_paced(connected.node.get(), asked, &pace, nullptr, NIF_FOREVER),
                NIF_OK);
    });
    give(connected.hub, subscribe_of(connected.hub, name), group);
    asking.join();
  }
  connected.hub.close();
  connected.hub = hub.admit(make_welcome());
  const Asked first = subscribe_of(connected.hub, "peer/a");
  const Asked second = subscribe_of(connected.hub, "peer/b");
  if (first_answers_first) give(connected.hub, first, first_group);
  give(connected.hub, second, second_group);
  if (!first_answers_first) give(connected.hub, first, first_group);
  for (int i = 0; i < 2; ++i) static_cast<void>(take(connected.node.get(), NIF_SERVICE_MOVED));
  for (const std::uint32_t group : {first_group, second_group}) {
    publish(connected.hub, group);
    static_cast<void>(take(connected.node.get()));
    EXPECT_EQ(credited_of(connected.hub, group), 1u) << "the window would be shut for ever";
  }
}

TEST(CreditBook, CountsGroupsThatAHubGaveToOthersWhenItBeganAnew) {
  swap_groups(true, kMovedGroup, kGroup);
  swap_groups(false, kMovedGroup, kGroup);
  swap_groups(true, kMovedGroup, kMovedGroup + 1);
  swap_groups(false, kMovedGroup + 1, kGroup);
}

}  // namespace
}  // namespace gimnet::nif
