#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include "client/gimi/service_table.hpp"
#include "proto/control/link.hpp"
#include "proto/control/ns.hpp"
#include "proto/frame/flow.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

// Tests a table that tells what its subscriptions missed.

namespace gimnet::gimi {
namespace {

namespace ns = proto::ns;

constexpr std::uint32_t kGroup = (7u << 20) | 11;

proto::Welcome welcome() {
  proto::Welcome welcome = nif::test::make_welcome();
  welcome.features |= proto::kFeatureMissed;
  return welcome;
}

class MissedOfSubscriptions : public testing::Test {
 protected:
  MissedOfSubscriptions() { uplink_.open(connected_.node.get()); }
  ~MissedOfSubscriptions() override { connected_.hub.close(); }

  ServiceTable::Reading subscribe() {
    ServiceTable::Reading made;
    std::thread asking(
        [&] { made = table_.subscribe("robot/eye", {.timeout = kForever}).or_throw(); });
    std::uint16_t number = 0;
    EXPECT_TRUE(connected_.hub.next_request<ns::Subscribe>(number));
    ns::SubscribeAnswer answer;
    answer.group = GroupId{kGroup};
    answer.provider = NodeId{nif::test::kPeerId};
    connected_.hub.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
    asking.join();
    return made;
  }

  /// Whether the hub is told of so many.
  bool is_told(std::uint64_t total) {
    const auto deadline = std::chrono::steady_clock::now() + nif::test::kPatience;
    while (std::chrono::steady_clock::now() < deadline) {
      const auto frame = connected_.hub.next();
      if (!frame) return false;
      if (frame->flow() == proto::flow::Message{proto::flow::Missed{GroupId{kGroup}, total}})
        return true;
    }
    return false;
  }

  nif::test::FakeHub hub_;
  nif::test::Connected connected_ =
      nif::test::connect_to(hub_, nif::test::default_options("viewer"), welcome());
  Uplink uplink_;
  Inbox inbox_{8, 1 << 20, [] {}};
  ServiceTable table_{uplink_, inbox_, [](const std::string&, const ServicePlace&) {}};
};

TEST_F(MissedOfSubscriptions, HoldNobodyUpWhileStandardErrorTakesNothing) {
  const ServiceTable::Reading reading = subscribe();
  reading.service->miss({Peer{nif::test::kPeerId}, {}, 5, 9});
  ASSERT_EQ(setenv("GIMNET_LOG", "info", 1), 0);
  flockfile(stderr);  // for other threads as a pipe that is full
  std::thread telling([&] { table_.tell_missed(); });
  EXPECT_TRUE(is_told(1));
  std::atomic<bool> found{false};
  std::thread looking(
      [&] { found = table_.subscribed(kGroup).place == ServiceTable::Place::found; });
  const auto deadline = std::chrono::steady_clock::now() + nif::test::kPatience;
  while (!found && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
  EXPECT_TRUE(found) << "the table is free";
  funlockfile(stderr);
  telling.join();
  looking.join();
  unsetenv("GIMNET_LOG");
}

}  // namespace
}  // namespace gimnet::gimi
