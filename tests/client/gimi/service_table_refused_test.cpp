#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "client/gimi/service_table.hpp"
#include "proto/control/ns.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

// Tests calls of a program by the name of a subscription that the hub did not take again after a
// break.

namespace gimnet::gimi {
namespace {

namespace ns = proto::ns;

constexpr std::uint32_t kGroup = (7u << 20) | 11;
constexpr const char* kName = "robot/odom";
constexpr std::uint32_t kWindow = 2;
constexpr SubscribeOptions kWish{.timeout = kForever, .window = kWindow};

class RefusedSubscriptions : public testing::Test {
 protected:
  RefusedSubscriptions() {
    uplink_.open(connected_.node.get());
    std::thread asking([&] { first_ = table_.subscribe(kName, kWish).or_throw(); });
    answer_subscribe(kWindow, proto::Status::done);
    asking.join();
    refuse();
  }
  ~RefusedSubscriptions() override { connected_.hub.close(); }

  /// Answers the next SUBSCRIBE, which has to ask for that window.
  void answer_subscribe(std::uint32_t window, proto::Status status) {
    std::uint16_t number = 0;
    const auto request = connected_.hub.next_request<ns::Subscribe>(number);
    ASSERT_TRUE(request);
    EXPECT_EQ(request->window, window);
    ns::SubscribeAnswer answer;
    answer.group = GroupId{kGroup};
    answer.provider = NodeId{nif::test::kPeerId};
    const proto::ControlHeader header{ns::Subscribe::kOperation, number};
    connected_.hub.send_control(proto::Kind::ns,
                                status == proto::Status::done
                                    ? proto::encode_answer(answer, number)
                                    : proto::encode_refusal(header, {status, "still no"}));
  }
  /// As NIF tells it after a break.
  void refuse() {
    constexpr std::string_view kWords = "no more";
    nif_incoming moved{};
    moved.text = kName;
    moved.reason = NIF_LIMIT;
    moved.payload = kWords.data();
    moved.size = kWords.size();
    EXPECT_EQ(table_.on_service_moved(moved), ServiceTable::Place::found);
    EXPECT_TRUE(first_.service->standing().is(Status::limit));
    moves_.clear();
  }

  nif::test::FakeHub hub_;
  nif::test::Connected connected_ =
      nif::test::connect_to(hub_, nif::test::default_options("viewer"), nif::test::make_welcome());
  Uplink uplink_;
  Inbox inbox_{1, 1 << 20, [] {}};
  std::vector<std::uint32_t> moves_;  ///< groups that streams were told
  ServiceTable table_{uplink_, inbox_, [this](const std::string&, const ServicePlace& place) {
                        moves_.push_back(place.group);
                      }};
  ServiceTable::Reading first_;
};

TEST_F(RefusedSubscriptions, AreAskedForWithTheNextReader) {
  std::thread asking(
      [&] { EXPECT_EQ(table_.subscribe(kName, kWish).or_throw().service, first_.service); });
  answer_subscribe(kWindow, proto::Status::done);
  asking.join();
  EXPECT_TRUE(first_.service->standing());
  EXPECT_EQ(table_.subscribed(kGroup).service, first_.service);
  EXPECT_EQ(moves_, std::vector<std::uint32_t>{kGroup}) << "no other word of it comes";
}

TEST_F(RefusedSubscriptions, AreNoOthersWhereTheHubRefusesThemAgain) {
  std::thread asking([&] {
    const auto again = table_.subscribe(kName, kWish);
    ASSERT_TRUE(again.is(Status::limit));
    EXPECT_NE(again.failure().sentence.find("still no"), std::string::npos);
  });
  answer_subscribe(kWindow, proto::Status::limit);
  asking.join();
  EXPECT_TRUE(first_.service->standing().is(Status::limit));
  EXPECT_EQ(table_.subscriptions(), 1u) << "the first subscriber is there still";
  EXPECT_TRUE(moves_.empty());
  std::thread once_more([&] { EXPECT_TRUE(table_.subscribe(kName, kWish)); });
  answer_subscribe(kWindow, proto::Status::done);
  once_more.join();
  EXPECT_TRUE(first_.service->standing());
}

TEST_F(RefusedSubscriptions, AreAskedForWhereTheyAreToBeSentTo) {
  std::thread asking([&] {
    static_cast<void>(table_.follow(kName, kForever,
                                    [](const ServicePlace& place) -> Outcome<ServiceTable::Stream> {
                                      EXPECT_EQ(place.group, kGroup);
                                      return Failure{Status::closed, "no stream is needed here"};
                                    }));
  });
  answer_subscribe(kWindow, proto::Status::done);
  asking.join();
  EXPECT_TRUE(first_.service->standing());
}

}  // namespace
}  // namespace gimnet::gimi
