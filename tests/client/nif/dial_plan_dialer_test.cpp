#include "client/nif/dial_plan.hpp"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

#include "tests/client/nif/support/fake_hub.hpp"

namespace gimnet::nif::test {
namespace {

TEST(Dialer, TriesAddressesInTurn) {
  FakeHub hub;
  std::vector<net::Address> addresses{*net::parse_address("unix:/nonexistent/socket"),
                                      *net::parse_address(hub.url())};
  std::thread admitting([&hub] {
    FakeConnection connection = hub.admit(make_welcome());
    EXPECT_TRUE(connection.wait_closed());
  });
  const net::WakeSignal cancel;
  {
    const auto admitted = admit(addresses, {}, proto::Hello{}, deadline_after(20'000), cancel);
    ASSERT_TRUE(admitted);
    EXPECT_EQ(admitted->session.id, kOwnId);
  }
  admitting.join();
}

TEST(Dialer, ARefusalIsNotTriedElsewhere) {
  FakeHub refusing;
  FakeHub other;
  std::vector<net::Address> addresses{*net::parse_address(refusing.url()),
                                      *net::parse_address(other.url())};
  std::thread answering([&refusing] {
    FakeConnection connection = refusing.accept();
    EXPECT_TRUE(connection.read_hello());
    connection.send(proto::kOpening);
    connection.goodbye(proto::GoodbyeCode::name_taken, "");
  });
  const net::WakeSignal cancel;
  const auto admitted = admit(addresses, {}, proto::Hello{}, deadline_after(20'000), cancel);
  ASSERT_FALSE(admitted);
  EXPECT_EQ(admitted.error().status, NIF_NAME_TAKEN);
  answering.join();
}

TEST(Dialer, AHubThatIsFullOrEndsIsNotTheLast) {
  for (const proto::GoodbyeCode code :
       {proto::GoodbyeCode::hub_full, proto::GoodbyeCode::draining}) {
    FakeHub refusing;
    FakeHub other;
    std::vector<net::Address> addresses{*net::parse_address(refusing.url()),
                                        *net::parse_address(other.url())};
    std::thread answering([&] {
      FakeConnection connection = refusing.accept();
      EXPECT_TRUE(connection.read_hello());
      connection.send(proto::kOpening);
      connection.goodbye(code, "");
      FakeConnection second = other.admit(make_welcome());
      EXPECT_TRUE(second.wait_closed());
    });
    const net::WakeSignal cancel;
    EXPECT_TRUE(admit(addresses, {}, proto::Hello{}, deadline_after(20'000), cancel));
    answering.join();
  }
}

TEST(Dialer, CanBeCancelled) {
  FakeHub hub;
  std::vector<net::Address> addresses{*net::parse_address(hub.url())};
  net::WakeSignal cancel;
  std::thread cancelling([&] {
    FakeConnection connection = hub.accept();
    EXPECT_TRUE(connection.read_hello());
    cancel.raise();
    EXPECT_TRUE(connection.wait_closed());
  });
  const auto admitted = admit(addresses, {}, proto::Hello{}, kNever, cancel);
  ASSERT_FALSE(admitted);
  EXPECT_EQ(admitted.error().status, NIF_CLOSED);
  cancelling.join();
}

}  // namespace
}  // namespace gimnet::nif::test
