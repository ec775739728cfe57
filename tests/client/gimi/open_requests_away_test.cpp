#include <gtest/gtest.h>

#include "base/clock.hpp"
#include "client/gimi/open_requests.hpp"
#include "tests/client/gimi/support/conversation.hpp"

// Requests to a service of which the program is away.

namespace gimnet::gimi {
namespace {

constexpr const char* kService = "calc/add";
constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr ServicePlace kThere{
    .group = 9, .provider = 18, .session = 3, .key = {7, 1}, .accepts = true};

ServicePlace away() {
  ServicePlace place = kThere;
  place.away = true;
  return place;
}

class OpenRequestsAway : public ::testing::Test {
 protected:
  OpenRequestsAway() { uplink_.open(connected_.node.get()); }
  ~OpenRequestsAway() override { connected_.hub.close(); }

  std::uint32_t ask(const RequestOptions& options = {}) {
    return requests_.open(kService, std::string_view("1"), deadline_, options).or_throw();
  }
  /// Time goes by, far longer than a request looks for a way to nobody.
  void pass_ten_seconds() {
    for (int second = 0; second < 10; ++second)
      static_cast<void>(requests_.tick(steady_now_ns() + second * kSecondNs));
  }
  std::optional<Ended> end_of(std::uint32_t number) { return requests_.wait(number, 0); }

  const std::int64_t deadline_ = steady_now_ns() + 1'000 * kSecondNs;
  test::FakeHub hub_;
  nif::test::Connected connected_ =
      nif::test::connect_to(hub_, nif::test::default_options(), nif::test::make_welcome());
  Uplink uplink_;
  OpenRequests requests_{uplink_, [] {}};
};

TEST_F(OpenRequestsAway, WaitForTheProgram) {
  requests_.learn(kService, nullptr, away());
  const std::uint32_t number = ask();
  pass_ten_seconds();
  EXPECT_FALSE(end_of(number));
  requests_.on_service_moved(kService, kThere);
  EXPECT_TRUE(requests_.tick(steady_now_ns()));
  const auto frame = connected_.hub.next_message();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->header.kind, proto::Kind::service);
  EXPECT_EQ(frame->header.dst, kThere.group);
  EXPECT_FALSE(requests_.tick(steady_now_ns())) << "it was sent";
}

TEST_F(OpenRequestsAway, EndAtTheirDeadline) {
  requests_.learn(kService, nullptr, away());
  const std::uint32_t number = ask();
  static_cast<void>(requests_.tick(deadline_));
  const auto ended = end_of(number);
  ASSERT_TRUE(ended);
  EXPECT_EQ(ended->status, Status::timeout);
  EXPECT_EQ(ended->ran, Ran::no);
}

TEST_F(OpenRequestsAway, OnesThatTheHubDroppedAreSentAgain) {
  requests_.learn(kService, nullptr, kThere);
  const std::uint32_t number = ask();
  ASSERT_TRUE(connected_.hub.next_message());
  requests_.on_service_moved(kService, away());
  requests_.on_report(number, NIF_DROP_AWAY, "it was away");
  pass_ten_seconds();
  EXPECT_FALSE(end_of(number));
  requests_.on_service_moved(kService, kThere);
  static_cast<void>(requests_.tick(steady_now_ns()));
  EXPECT_TRUE(connected_.hub.next_message());
}

// A program that was started again under the same session draws another instance.
TEST_F(OpenRequestsAway, OneThatAFormerProgramMayHaveDoneEnds) {
  requests_.learn(kService, nullptr, kThere);
  const std::uint32_t once = ask();
  const std::uint32_t again = ask({.repeat = true});
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(connected_.hub.next_message());
  requests_.on_service_moved(kService, away());
  EXPECT_FALSE(end_of(once));
  ServicePlace next = kThere;
  next.key.instance = 2;
  requests_.on_service_moved(kService, next);
  const auto ended = end_of(once);
  ASSERT_TRUE(ended);
  EXPECT_EQ(ended->status, Status::gone);
  EXPECT_EQ(ended->ran, Ran::maybe);
  static_cast<void>(requests_.tick(steady_now_ns()));
  EXPECT_TRUE(connected_.hub.next_message()) << "it may be done twice";
  EXPECT_FALSE(end_of(again));
}

}  // namespace
}  // namespace gimnet::gimi
