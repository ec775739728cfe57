#include "client/nif/credit_book.hpp"

#include <gtest/gtest.h>

#include <array>
#include <string>
#include <thread>
#include <utility>

#include "proto/control/ns.hpp"
#include "proto/frame/fragment_header.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

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
  ASSERT_TRUE(hub.next_request<proto::ns::Subscribe>(number));
  proto::ns::SubscribeAnswer answer;
  answer.group = GroupId{group};
  answer.delivery = proto::ns::Delivery::sync;
  answer.window = window;
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

TEST(CreditBook, CountsWhatCameBeforeTheAnswer) {
  FakeHub hub;
  Connected connected = connect_to(hub, test::default_options(), make_welcome());
  subscribe_late(connected, 1);
  static_cast<void>(take(connected.node.get()));
  EXPECT_EQ(credited(connected.hub), 1u) << "the window would be shut for ever";
  publish(connected.hub);
  static_cast<void>(take(connected.node.get()));
  EXPECT_EQ(credited(connected.hub), 2u);
}

TEST(CreditBook, DoesNotCreditWhatCameBeforeAnAnswerWithoutAWindow) {
  FakeHub hub;
  Connected connected = connect_to(hub, test::default_options(), make_welcome());
  subscribe_late(connected, 0);
  publish(connected.hub);
  static_cast<void>(take(connected.node.get()));
  EXPECT_EQ(take(connected.node.get()).epoch, 0u);
  subscribe(connected, 1);
  publish(connected.hub);
  static_cast<void>(take(connected.node.get()));
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

/// A service came back under kMovedGroup while the node was away: its first messages come before
/// anything is declared.
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

TEST(CreditBook, CountsWhatComesBeforeASubscriptionIsDeclaredAgain) {
  constexpr int kServices = 40;  // they are declared first, and not all at once
  FakeHub hub;
  Connected connected = connect_to(hub, test::default_options("robot"), make_welcome(1 << 20));
  const auto answer_advertise = [&](std::uint32_t i) {
    std::uint16_t number = 0;
    ASSERT_TRUE(connected.hub.next_request<proto::ns::Advertise>(number));
    proto::ns::AdvertiseAnswer answer;
    answer.group = GroupId{kGroup + 100 + i};
    connected.hub.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
  };
  for (std::uint32_t i = 0; i < kServices; ++i) {
    std::thread asking([&] {
      const std::string name = "s" + std::to_string(i);
      nif_service service{};
      service.struct_size = sizeof service;
      service.name = name.c_str();
      std::uint32_t group = 0;
      EXPECT_EQ(nif_advertise(connected.node.get(), &service, &group, nullptr, NIF_FOREVER),
                NIF_OK);
    });
    answer_advertise(i);
    asking.join();
  }
  subscribe(connected, 1);
  publish(connected.hub);
  static_cast<void>(take(connected.node.get()));
  EXPECT_EQ(credited(connected.hub), 1u);
  connected.hub.close();
  connected.hub = come_back_resumed(hub);
  publish(connected.hub, kMovedGroup);
  EXPECT_NE(take(connected.node.get()).epoch, 0u) << "before any SUBSCRIBE was sent";
  for (std::uint32_t i = 0; i < kServices; ++i) answer_advertise(i);
  answer_subscribe(connected.hub, 1, kMovedGroup);
  EXPECT_EQ(credited_of(connected.hub, kMovedGroup), 1u) << "the window would be shut for ever";
  // The former group is gone, and nothing is told of it any more.
  connected.hub.close();
  connected.hub = come_back_resumed(hub);
  const auto repeated = connected.hub.next_flow<proto::flow::Credit>();
  ASSERT_TRUE(repeated);
  EXPECT_EQ(repeated->group, GroupId{kMovedGroup});
}

TEST(CreditBook, CountsWhatComesBeforeASubscribeThatBrokeIsAskedAgain) {
  FakeHub hub;
  Connected connected = connect_to(hub, test::default_options("robot"), make_welcome(1 << 20));
  std::thread asking([&] {
    EXPECT_EQ(nif_subscribe(connected.node.get(), "peer/scan", nullptr, NIF_FOREVER), NIF_OK);
  });
  std::uint16_t number = 0;
  EXPECT_TRUE(connected.hub.next_request<proto::ns::Subscribe>(number));
  connected.hub.close();  // it has heard the SUBSCRIBE, and nobody its answer
  connected.hub = come_back_resumed(hub);
  publish(connected.hub);
  static_cast<void>(take(connected.node.get()));
  answer_subscribe(connected.hub, 1);
  EXPECT_EQ(credited(connected.hub), 1u) << "the window would be shut for ever";
  answer_subscribe(connected.hub, 1);  // a call that was asked on two connections asks once more
  asking.join();
}

TEST(CreditBook, FormerGroupsMakeWay) {
  constexpr std::uint32_t kGroups = 4096;
  FakeHub hub;
  Connected connected = connect_to(hub, test::default_options(), make_welcome());
  for (std::uint32_t i = 1; i <= kGroups; ++i) {
    publish(connected.hub, kGroup + i);
    EXPECT_NE(take(connected.node.get()).epoch, 0u);
  }
  subscribe_late(connected, 1);
  static_cast<void>(take(connected.node.get()));
  EXPECT_EQ(credited(connected.hub), 1u);
}

TEST(CreditBook, AGroupWithoutAWindowMayHaveOneAfterABreak) {
  FakeHub hub;
  Connected connected = connect_to(hub, test::default_options("robot"), make_welcome(1 << 20));
  subscribe(connected, 0);
  publish(connected.hub);
  EXPECT_EQ(take(connected.node.get()).epoch, 0u);
  connected.hub.close();
  connected.hub = come_back_resumed(hub);
  publish(connected.hub);
  static_cast<void>(take(connected.node.get()));
  answer_subscribe(connected.hub, 1);
  EXPECT_EQ(credited(connected.hub), 1u);
}

/// The next request is SUBSCRIBE of `name`; its answer has to wait for its turn.
std::uint16_t subscribe_of(FakeConnection& hub, const std::string& name) {
  std::uint16_t number = 0;
  const auto request = hub.next_request<proto::ns::Subscribe>(number);
  EXPECT_TRUE(request && request->name == name);
  return number;
}

void give(FakeConnection& hub, std::uint16_t number, std::uint32_t group) {
  proto::ns::SubscribeAnswer answer;
  answer.group = GroupId{group};
  answer.window = 1;
  hub.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
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
  const std::uint16_t first = subscribe_of(connected.hub, "peer/a");
  const std::uint16_t second = subscribe_of(connected.hub, "peer/b");
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
