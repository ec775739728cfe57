#include "client/gimi/turns.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <thread>

#include "client/gimi/service_table.hpp"
#include "proto/control/ns.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

namespace gimnet::gimi {
namespace {

namespace ns = proto::ns;

TEST(Turns, DoNotComeWithinTheTimeGiven) {
  Turns turns;
  const Turn first(turns, kForever);
  EXPECT_TRUE(first);
  std::thread([&turns] {
    const Turn second(turns, Timeout{1});
    EXPECT_FALSE(second);
    EXPECT_EQ(second.left_ms(), 0);
    const Turn third(turns, kNoWait);
    EXPECT_FALSE(third);
  }).join();
}

TEST(Turns, ComeToThoseWhoWait) {
  Turns turns;
  std::uint32_t inside = 0;
  const auto go_in = [&] {
    for (int i = 0; i < 1000; ++i) {
      const Turn turn(turns, i % 2 == 0 ? kForever : Timeout{60'000});
      EXPECT_TRUE(turn);
      EXPECT_EQ(++inside, 1u);
      --inside;
    }
  };
  std::thread other(go_in);
  go_in();
  other.join();
}

TEST(Turns, OfAnEndComeAlwaysAndLeaveItLessTime) {
  Turns turns;
  const Turn turn(turns, Turn::Leaving{});
  EXPECT_TRUE(turn);
  EXPECT_GT(turn.left_ms(), 0);
  EXPECT_LE(turn.left_ms(), kLeaveTimeoutMs);
}

/// A hub that answers nothing.
class SilentHub : public testing::Test {
 protected:
  SilentHub() { uplink_.open(connected_.node.get()); }
  ~SilentHub() override { connected_.hub.close(); }

  nif::test::FakeHub hub_;
  nif::test::Connected connected_ =
      nif::test::connect_to(hub_, nif::test::default_options("viewer"), nif::test::make_welcome());
  Uplink uplink_;
  Inbox inbox_{8, 1 << 20, [] {}};
  ServiceTable table_{uplink_, inbox_, [](const std::string&, const ServicePlace&) {}};
};

TEST_F(SilentHub, KeepsNoCallLongerThanItWants) {
  std::thread patient([this] {
    EXPECT_TRUE(table_.subscribe("robot/odom", {.timeout = kForever}).is(Status::limit));
  });
  std::uint16_t number = 0;
  ASSERT_TRUE(connected_.hub.next_request<ns::Subscribe>(number));
  const Timeout soon{1};
  const auto subscribed = table_.subscribe("robot/pose", {.timeout = soon});
  ASSERT_TRUE(subscribed.is(Status::timeout));
  EXPECT_NE(subscribed.failure().sentence.find("other calls"), std::string::npos)
      << subscribed.failure().sentence;
  EXPECT_TRUE(table_.advertise("robot", "odom", {}, soon).is(Status::timeout));
  EXPECT_TRUE(table_.accept("robot", "drive", {}, soon).is(Status::timeout));
  const auto followed =
      table_.follow("robot/drive", soon, [](const ServicePlace&) -> Outcome<ServiceTable::Stream> {
        return Failure{Status::closed, "no stream is needed here"};
      });
  EXPECT_TRUE(followed.is(Status::timeout));
  connected_.hub.send_control(proto::Kind::ns,
                              proto::encode_refusal({ns::Subscribe::kOperation, number},
                                                    {proto::Status::limit, "the test is over"}));
  patient.join();
}

}  // namespace
}  // namespace gimnet::gimi
