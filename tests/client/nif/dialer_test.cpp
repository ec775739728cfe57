#include "client/nif/dialer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <thread>

#include "tests/client/nif/support/fake_hub.hpp"

namespace gimnet::nif::test {
namespace {

TEST(Dialer, TriesAddressesInTurn) {
  FakeHub hub;
  std::vector<Endpoint> endpoints{*parse_endpoint("unix:/nonexistent/socket"),
                                  *parse_endpoint(hub.url())};
  std::thread admitting([&hub] {
    FakeConnection connection = hub.admit(make_welcome());
    EXPECT_TRUE(connection.wait_closed());
  });
  const WakeSignal cancel;
  {
    const auto admitted = admit(endpoints, {}, proto::Hello{}, deadline_after(20'000), cancel);
    ASSERT_TRUE(admitted);
    EXPECT_EQ(admitted->session.id, kOwnId);
  }
  admitting.join();
}

TEST(Dialer, ARefusalIsNotTriedElsewhere) {
  FakeHub refusing;
  FakeHub other;
  std::vector<Endpoint> endpoints{*parse_endpoint(refusing.url()), *parse_endpoint(other.url())};
  std::thread answering([&refusing] {
    FakeConnection connection = refusing.accept();
    EXPECT_TRUE(connection.read_hello());
    connection.send(proto::kOpening);
    connection.goodbye(proto::GoodbyeCode::name_taken, "");
  });
  const WakeSignal cancel;
  const auto admitted = admit(endpoints, {}, proto::Hello{}, deadline_after(20'000), cancel);
  ASSERT_FALSE(admitted);
  EXPECT_EQ(admitted.error().status, NIF_NAME_TAKEN);
  answering.join();
}

TEST(Dialer, CanBeCancelled) {
  FakeHub hub;
  std::vector<Endpoint> endpoints{*parse_endpoint(hub.url())};
  WakeSignal cancel;
  std::thread cancelling([&] {
    FakeConnection connection = hub.accept();
    EXPECT_TRUE(connection.read_hello());
    cancel.raise();
    EXPECT_TRUE(connection.wait_closed());
  });
  const auto admitted = admit(endpoints, {}, proto::Hello{}, kNever, cancel);
  ASSERT_FALSE(admitted);
  EXPECT_EQ(admitted.error().status, NIF_CLOSED);
  cancelling.join();
}

TEST(Dialer, BacksOffFrom50MillisecondsToASecond) {
  Backoff backoff;
  constexpr std::uint64_t kMs = 1'000'000;
  for (const std::uint64_t limit_ms : {50u, 100u, 200u, 400u, 800u, 1000u, 1000u}) {
    EXPECT_EQ(backoff.next_ns(limit_ms * kMs - 1), static_cast<std::int64_t>(limit_ms * kMs - 1));
  }
  backoff.reset();
  EXPECT_EQ(backoff.next_ns(50 * kMs), 0);
}

TEST(Dialer, BacksOffWithinBoundsHoweverOftenItFails) {
  Backoff backoff;
  std::mt19937_64 random{5};
  std::int64_t longest = 0;
  for (int failures = 0; failures < 1'000'000; ++failures) {
    const std::int64_t wait_ns = backoff.next_ns(random());
    ASSERT_GE(wait_ns, 0);
    ASSERT_LT(wait_ns, 1'000'000'000);
    longest = std::max(longest, wait_ns);
  }
  EXPECT_GT(longest, 990'000'000) << "it goes on waiting up to a second";
  EXPECT_EQ(backoff.next_ns(999'999'999), 999'999'999);
  EXPECT_LT(backoff.next_ns(UINT64_MAX), 1'000'000'000);
}

}  // namespace
}  // namespace gimnet::nif::test
