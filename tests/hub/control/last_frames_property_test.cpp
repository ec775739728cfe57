// Messages that a provider sent before it ended its service reach the subscribers on every shard,
// however late one of them is: the conductor and two shards, in any order of their turns that a
// seed says.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "base/log.hpp"
#include "hub/control/conductor.hpp"
#include "proto/control/ns_register.hpp"
#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::Kind;
using std::chrono::milliseconds;
using testing::FakeNode;
using testing::HubRig;
namespace ns = proto::ns;

enum class End { withdraw, rename, goodbye, other_terms };

class World final : private ShardProxy {
 public:
  explicit World(std::uint32_t seed)
      : random_(seed), retain_(seed % 2 == 1), stopped_(seed % 3 == 0) {}

  void begin() {
    for (FakeNode* each : {&near_, &far_}) ask(*each, ns::Subscribe{.name = "robot/odom"});
    ask(robot_, advertise());
    settle();
    const auto& groups = conductor_.membership().topics().groups();
    ASSERT_EQ(groups.size(), 1u);
    group_ = groups.begin()->first.value();
  }

  void send_some() {
    for (std::size_t i = below(6); i != 0; --i) {
      sent_.push_back(std::to_string(sent_.size()));
      rig_.send(robot_, HubRig::group(group_), sent_.back(), {.kind = Kind::group});
      if (below(3) == 0) step();
    }
  }
  void end(End how) {
    switch (how) {
      case End::withdraw:
        return ask(robot_, ns::Withdraw{GroupId{HubRig::group(group_)}});
      case End::rename:
        return ask(robot_, ns::RegisterName{.name = "other"});
      case End::other_terms: {
        ns::Advertise other = advertise();
        other.message_type = 9;
        return ask(robot_, other);
      }
      case End::goodbye: {
        const auto payload = proto::encode(proto::Goodbye{proto::GoodbyeCode::done, ""});
        return rig_.send(robot_, 0, text_of(payload), {.kind = Kind::link});
      }
    }
  }
  /// A turn of one of the three.
  void step() {
    switch (below(3)) {
      case 0:
        return rig_.turn_shard(0);
      case 1:
        return stopped_ ? void() : rig_.turn_shard(1);
      default:
        static_cast<void>(tell_conductor());
    }
  }
  void settle() {
    for (int quiet = 0; quiet < 3;) {
      rig_.settle();
      quiet = tell_conductor() ? 0 : quiet + 1;
    }
  }

  std::size_t below(std::size_t bound) { return random_() % bound; }
  HubRig& rig() { return rig_; }
  [[nodiscard]] const std::vector<std::string>& sent() const { return sent_; }
  [[nodiscard]] std::uint32_t group() const { return group_; }
  FakeNode& robot() { return robot_; }
  FakeNode& near() { return near_; }
  FakeNode& far() { return far_; }

 private:
  static HubFacts facts() {
    HubFacts facts;
    facts.id = HubId{7};
    facts.name = "hub";
    facts.shards = 2;
    return facts;
  }
  [[nodiscard]] ns::Advertise advertise() const {
    ns::Advertise advertise;
    advertise.service = "odom";
    advertise.retain = retain_;
    return advertise;
  }
  static std::string text_of(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  template <class Message>
  void ask(FakeNode& node, const Message& message) {
    rig_.send(node, 0, text_of(proto::encode(message, ++requests_)), {.kind = Kind::ns});
  }

  FakeNode& join(const std::string& name, std::uint16_t shard) {
    auto [transport, peer] = make_memory_pipe();
    Stranger stranger;
    stranger.transport = std::move(transport);
    proto::Hello hello;
    hello.name = name;
    hello.shard = shard;
    const auto refusal = conductor_.admit(stranger, hello, {milliseconds{1'000}, 1'000'000'000});
    EXPECT_FALSE(refusal);
    FakeNode node = joined_;
    node.pipe = peer;
    return rig_.adopt(std::move(node));
  }
  void send(ShardIndex shard, ShardCommand command) override {
    if (const auto* attach = std::get_if<AttachCommand>(&command)) {
      joined_.id = attach->node;
      joined_.shard = shard;
      joined_.session = attach->session;
      joined_.attachment = attach->attachment;
    }
    rig_.command(shard.value(), std::move(command));
  }
  [[nodiscard]] std::size_t shards() const override { return 2; }
  bool tell_conductor() {
    std::vector<ShardEvent> events = rig_.take_events();
    for (ShardEvent& event : events) conductor_.on_event(std::move(event), milliseconds{1'000});
    return !events.empty();
  }

  std::mt19937 random_;
  const bool retain_;
  const bool stopped_;  ///< the shard of far() takes no turn before all is settled
  HubRig rig_{2};
  Limits limits_;
  ShardCounters counters_[2];
  const ShardCounters* readable_[2] = {&counters_[0], &counters_[1]};
  Conductor conductor_{facts(), Placement::spread, limits_,
                       Conductor::Wiring{.shards = *this,
                                         .tables = {rig_.nodes(), rig_.groups(), rig_.quiescence()},
                                         .counters = readable_}};
  std::uint16_t requests_ = 0;
  FakeNode joined_;
  FakeNode& robot_ = join("robot", 0);
  FakeNode& near_ = join("near", 0);
  FakeNode& far_ = join("far", 1);
  std::vector<std::string> sent_;
  std::uint32_t group_ = 0;
};

class LastFrames : public ::testing::TestWithParam<End> {
 protected:
  LastFrames() { set_log_level(LogLevel::off); }
  ~LastFrames() override { set_log_level(LogLevel::info); }
};

INSTANTIATE_TEST_SUITE_P(Ends, LastFrames,
                         ::testing::Values(End::withdraw, End::rename, End::goodbye,
                                           End::other_terms));

TEST_P(LastFrames, ReachSubscribersOnEveryShard) {
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    SCOPED_TRACE(seed);
    World world(seed);
    world.begin();
    for (std::size_t rounds = 1 + world.below(3); rounds != 0; --rounds) world.send_some();
    world.end(GetParam());
    for (std::size_t steps = world.below(20); steps != 0; --steps) world.step();
    world.settle();
    const GroupMembers* members = world.rig().groups().find(world.group());
    if (GetParam() == End::other_terms) {
      // The group is gone at once: what is on its way to another shard is dropped and counted.
      EXPECT_EQ(members, nullptr);
      const std::size_t got = world.near().texts().size() + world.far().texts().size();
      EXPECT_EQ(got + world.rig().dropped(DropReason::no_such_group), 2 * world.sent().size());
    } else {
      EXPECT_EQ(world.near().texts(), world.sent());
      EXPECT_EQ(world.far().texts(), world.sent());
      EXPECT_EQ(world.rig().ledger().dropped, 0u);
      EXPECT_FALSE(members->provided());
    }
    EXPECT_EQ(world.rig().state(0).retained.groups(), 0u);
    const std::uint64_t dropped = world.rig().dropped(DropReason::no_such_group);
    if (GetParam() == End::goodbye) continue;
    world.rig().send(world.robot(), HubRig::group(world.group()), "too late",
                     {.kind = Kind::group});
    world.settle();
    EXPECT_EQ(world.rig().dropped(DropReason::no_such_group), dropped + 1);
  }
}

}  // namespace
}  // namespace gimnet::hub
