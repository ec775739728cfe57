#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "client/gimi/service_table.hpp"
#include "proto/control/ns.hpp"
#include "tests/client/gimi/support/made_message.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

// Tests the rest of a subscription whose last handle was dropped.

namespace gimnet::gimi {
namespace {

namespace ns = proto::ns;

constexpr std::uint32_t kGroup = (7u << 20) | 11;
constexpr const char* kName = "robot/drive";

class LeftSubscriptions : public testing::Test {
 protected:
  LeftSubscriptions() { uplink_.open(connected_.node.get()); }
  ~LeftSubscriptions() override { connected_.hub.close(); }

  /// Answers the next SUBSCRIBE, which has to ask for that window.
  void answer_subscribe(std::uint32_t window, proto::Status status = proto::Status::done,
                        bool retain = false) {
    std::uint16_t number = 0;
    const auto request = connected_.hub.next_request<ns::Subscribe>(number);
    ASSERT_TRUE(request);
    EXPECT_EQ(request->window, window);
    ns::SubscribeAnswer answer;
    answer.group = GroupId{kGroup};
    answer.provider = NodeId{nif::test::kPeerId};
    answer.retain = retain;
    const proto::ControlHeader header{ns::Subscribe::kOperation, number};
    connected_.hub.send_control(proto::Kind::ns,
                                status == proto::Status::done
                                    ? proto::encode_answer(answer, number)
                                    : proto::encode_refusal(header, {status, "no"}));
  }
  ServiceTable::Reading subscribe(const std::string& name = kName) {
    return subscribe(name, {.timeout = kForever, .window = 2}, 2);
  }
  ServiceTable::Reading subscribe(const std::string& name, const SubscribeOptions& wish,
                                  std::uint32_t window) {
    ServiceTable::Reading made;
    std::thread asking([&] { made = table_.subscribe(name, wish).or_throw(); });
    answer_subscribe(window);
    asking.join();
    return made;
  }
  void leave_with_an_answer(ServiceTable::Reading reading, std::uint32_t window) {
    std::thread leaving([&] { table_.unsubscribe(reading); });
    answer_subscribe(window);
    leaving.join();
  }
  /// The last handle of the name.
  void leave(ServiceTable::Reading reading) {
    std::thread leaving([&] { table_.unsubscribe(reading); });
    std::uint16_t number = 0;
    ASSERT_TRUE(connected_.hub.next_request<ns::Unsubscribe>(number));
    connected_.hub.send_control(proto::Kind::ns,
                                proto::encode_answer(ns::UnsubscribeAnswer{}, number));
    leaving.join();
  }
  /// A message comes to all subscribers of a service.
  static void put(const ServiceTable::Subscribed& service) {
    Message message = test::make_message("x");
    EXPECT_EQ(service->put({}, message), SubscribedService::Put::kept);
  }
  [[nodiscard]] std::uint64_t received(const ServiceTable::Reading& reading) {
    return inbox_.counts(reading.subscriber->queue).received;
  }
  /// It is read with a window of 2.
  void follow() {
    std::thread asking([this] {
      static_cast<void>(table_.follow(
          kName, kForever, [](const ServicePlace& place) -> Outcome<ServiceTable::Stream> {
            EXPECT_EQ(place.group, kGroup);
            return Failure{Status::closed, "no stream is needed here"};
          }));
    });
    answer_subscribe(2);
    asking.join();
  }

  nif::test::FakeHub hub_;
  nif::test::Connected connected_ =
      nif::test::connect_to(hub_, nif::test::default_options("viewer"), nif::test::make_welcome());
  Uplink uplink_;
  Inbox inbox_{1, 1 << 20, [] {}};
  ServiceTable table_{uplink_, inbox_, [](const std::string&, const ServicePlace&) {}};
};

TEST_F(LeftSubscriptions, NothingOfAsManyNamesAsAProgramLikes) {
  for (int i = 0; i < 100; ++i) {
    ServiceTable::Reading reading = subscribe("robot/s" + std::to_string(i));
    EXPECT_EQ(table_.subscriptions(), 1u);
    EXPECT_EQ(inbox_.queues(), 1u);
    leave(std::move(reading));
    EXPECT_EQ(table_.subscriptions(), 0u);
    EXPECT_EQ(inbox_.queues(), 0u);
  }
}

TEST_F(LeftSubscriptions, AllAsLongAsThereIsAReader) {
  ServiceTable::Reading first = subscribe();
  ServiceTable::Reading second = subscribe();
  table_.unsubscribe(std::exchange(first, {}));
  EXPECT_EQ(table_.subscriptions(), 1u);
  EXPECT_EQ(inbox_.queues(), 1u);
  EXPECT_EQ(table_.subscribed(kGroup).service, second.service);
  leave(std::move(second));
  EXPECT_EQ(table_.subscriptions(), 0u);
  EXPECT_EQ(table_.subscribed(kGroup).place, ServiceTable::Place::unwanted)
      << "what is still on its way is no loss";
}

TEST_F(LeftSubscriptions, WhatAFirstReaderHadIfASecondOneIsRefused) {
  const ServiceTable::Reading first = subscribe();
  std::thread asking(
      [&] { EXPECT_FALSE(table_.subscribe(kName, {.timeout = kForever, .window = 2})); });
  answer_subscribe(2, proto::Status::done, true);
  std::uint16_t number = 0;
  ASSERT_TRUE(connected_.hub.next_request<ns::Unsubscribe>(number));
  connected_.hub.send_control(proto::Kind::ns,
                              proto::encode_answer(ns::UnsubscribeAnswer{}, number));
  answer_subscribe(2, proto::Status::limit);
  answer_subscribe(2);
  asking.join();
  EXPECT_EQ(table_.subscribed(kGroup).service, first.service);
  EXPECT_FALSE(first.service->is_refused());
  leave(first);
}

TEST_F(LeftSubscriptions, NoMoreThanTheOthersWant) {
  ServiceTable::Reading narrow = subscribe();
  ServiceTable::Reading wide = subscribe(kName, {.timeout = kForever, .window = 7}, 7);
  ServiceTable::Reading all = subscribe(kName, {.timeout = kForever}, 0);
  leave_with_an_answer(std::move(all), 7);
  leave_with_an_answer(std::move(wide), 2);
  leave(std::move(narrow));
}

TEST_F(LeftSubscriptions, TheOthersRatesUntilTheHubKeepsThem) {
  const ServiceTable::Reading rare =
      subscribe(kName, {.rate_hz = 0.001, .queue = 9, .timeout = kForever}, 0);
  ServiceTable::Reading all = subscribe(kName, {.timeout = kForever}, 0);
  put(rare.service);
  EXPECT_EQ(received(rare), 1u) << "the first comes at once";
  std::thread leaving([&] { table_.unsubscribe(std::exchange(all, {})); });
  std::uint16_t number = 0;
  ASSERT_TRUE(connected_.hub.next_request<ns::Subscribe>(number));
  put(rare.service);
  put(rare.service);
  EXPECT_EQ(received(rare), 1u) << "the hub has not answered";
  connected_.hub.send_control(
      proto::Kind::ns,
      proto::encode_refusal({ns::Subscribe::kOperation, number}, {proto::Status::limit, "no"}));
  leaving.join();
  put(rare.service);
  put(rare.service);
  EXPECT_EQ(received(rare), 1u) << "the hub sends all as before";
  leave(rare);
}

TEST_F(LeftSubscriptions, ARateThatTheHubKeepsIsNotKeptTwice) {
  const ServiceTable::Reading rare =
      subscribe(kName, {.rate_hz = 0.001, .queue = 9, .timeout = kForever}, 0);
  leave_with_an_answer(subscribe(kName, {.timeout = kForever}, 0), 0);
  for (int i = 0; i < 3; ++i) put(rare.service);
  EXPECT_EQ(received(rare), 3u);
  leave(rare);
}

TEST_F(LeftSubscriptions, OnesThatWantTheNewestOnlyHaveAWindowOfTwo) {
  leave(subscribe(kName, {.newest_only = true, .timeout = kForever}, 2));
  leave(subscribe(kName, {.newest_only = true, .timeout = kForever, .window = 5}, 5));
}

TEST_F(LeftSubscriptions, NothingOfOneThatTheHubRefused) {
  std::thread asking([&] { EXPECT_FALSE(table_.subscribe(kName, {.timeout = kForever})); });
  answer_subscribe(0, proto::Status::limit);
  asking.join();
  EXPECT_EQ(table_.subscriptions(), 0u);
  EXPECT_EQ(inbox_.queues(), 0u);
}

// The library's thread has found where a message belongs, and the program leaves.
TEST_F(LeftSubscriptions, NobodyWhoTakesAMessageThatIsJustComing) {
  ServiceTable::Reading reading = subscribe();
  const ServiceTable::Subscribed found = table_.subscribed(kGroup).service;
  leave(std::move(reading));
  Message message = test::make_message("x");
  EXPECT_EQ(found->put({}, message), SubscribedService::Put::unwanted);
  EXPECT_EQ(message.text(), "x");
}

TEST_F(LeftSubscriptions, OneThatIsSentToIsFollowedWithoutAPace) {
  ServiceTable::Reading reading = subscribe();
  follow();
  leave_with_an_answer(std::move(reading), 0);
  EXPECT_EQ(table_.subscriptions(), 1u);
}

TEST_F(LeftSubscriptions, WhatEndedDuringABreakIsToldWithTheNextConnection) {
  const ServiceTable::Reading reading = subscribe();
  follow();
  connected_.hub.close();
  while (nif::test::info_of(connected_.node.get()).connected != 0) std::this_thread::yield();
  table_.unsubscribe(reading);  // which gives up waiting
  connected_.hub = hub_.admit(nif::test::make_welcome());
  answer_subscribe(0);
  EXPECT_EQ(table_.subscriptions(), 1u);
}

}  // namespace
}  // namespace gimnet::gimi
