// A hub's control plane after very many reconnects is as large as it was after few: what its nodes
// come back to, lose, leave behind and declare anew is counted in bytes that are allocated and not
// freed, at operator new. The conductor alone, in simulated time.

#include <gtest/gtest.h>
#include <malloc.h>

#include <cstdint>
#include <cstdlib>
#include <new>
#include <random>

#include "base/log.hpp"
#include "tests/hub/control/support/test_conductor.hpp"
#include "tests/stress/support/size.hpp"

namespace {
std::int64_t live_bytes = 0;

void* allocate(std::size_t size, std::size_t alignment) {
  void* memory =
      alignment <= alignof(std::max_align_t)
          ? std::malloc(size)
          : std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
  if (memory == nullptr) std::abort();
  live_bytes += static_cast<std::int64_t>(malloc_usable_size(memory));
  return memory;
}
void release(void* memory) {
  live_bytes -= static_cast<std::int64_t>(malloc_usable_size(memory));
  std::free(memory);
}
}  // namespace

void* operator new(std::size_t size) { return allocate(size, 1); }
void* operator new[](std::size_t size) { return allocate(size, 1); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept { release(memory); }
void operator delete[](void* memory) noexcept { release(memory); }
void operator delete(void* memory, std::size_t) noexcept { release(memory); }
void operator delete[](void* memory, std::size_t) noexcept { release(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { release(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { release(memory); }

namespace gimnet::hub {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t kNodes = 100;
/// Then the journal of changes is full, and the indices have come round: nothing has a reason to
/// grow any more.
constexpr std::uint64_t kWarmUp = 60'000;
/// Each index that was ever given out takes these bytes for good: the number of its last session
/// (NumberFloor), 8 MiB of all.
constexpr std::int64_t kBytesOfAnIndex = 8;
/// Two pages of these, and rounding of what grows by doubling. A leak of one byte a reconnect is
/// more.
constexpr std::int64_t kSlackBytes = 80 * 1024;

class LongRun : public ::testing::Test {
 protected:
  struct Member {
    std::string name;
    std::vector<std::byte> token;
    TestConductor::Node node;
    bool connected = false;
  };

  LongRun() { set_log_level(LogLevel::off); }

  /// The hub's indices are near their end, so that they soon come round.
  static HubStart near_the_end() {
    HubStart start;
    start.nodes.first = start.groups.first = kEveryIndex - 1'000;
    return start;
  }

  void come(Member& member) {
    proto::Hello hello;
    hello.name = member.name;
    hello.token = member.token;
    const NodeId former = member.node.id;
    member.node = hub_.join(hello);
    new_ids_ += member.node.id == former ? 0 : 1;
    member.token = member.node.welcome.token;
    member.connected = true;
    declare(member);
    settle();
  }

  void declare(Member& member) {
    const auto offered =
        hub_.ask<proto::ns::AdvertiseAnswer>(member.node, proto::ns::Advertise{.service = "data"});
    ASSERT_TRUE(offered) << offered.error().sentence;
    // Of one that is there, of one that may not be, and of a name that nobody has.
    for (const std::size_t other :
         {random_() % kNodes, random_() % kNodes, kNodes + random_() % 50}) {
      const auto wanted = hub_.ask<proto::ns::SubscribeAnswer>(
          member.node, proto::ns::Subscribe{.name = "node-" + std::to_string(other) + "/data"});
      ASSERT_TRUE(wanted) << wanted.error().sentence;
    }
    proto::ns::Watch watch;
    watch.watch = 1;
    watch.pattern = random_() % 2 == 0 ? "**" : "*/data";
    if (random_() % 20 != 0) return;
    ASSERT_TRUE(hub_.ask<proto::ns::WatchAnswer>(member.node, watch));
  }

  /// Does the work that the shards and the watching nodes do at once.
  void settle() {
    for (bool again = true; again;) {
      again = hub_.conductor.tell_rest(hub_.now);
      auto sent = std::exchange(hub_.shards.sent, {});
      for (const FakeShards::Sent& each : sent) again = react(each) || again;
      hub_.kept.clear();
      hub_.shards.told.clear();
    }
    if (const auto due = hub_.conductor.next_deadline(); due && *due <= hub_.now)
      hub_.conductor.tick(hub_.now);
  }
  bool react(const FakeShards::Sent& sent) {
    const auto* said = std::get_if<SendControlCommand>(&sent.command);
    if (said == nullptr) return false;
    const auto view = proto::split_control(TestConductor::payload_of(*said));
    if (view->header.operation != proto::ns::WatchEvents::kOperation) return false;
    for (const Member& member : members_) {
      if (!member.connected || member.node.attachment != said->attachment) continue;
      if (member.node.session.slot != said->session.slot || member.node.shard != sent.shard)
        continue;
      hub_.send_frame(member.node, proto::Kind::ns,
                      proto::encode(proto::ns::WatchTaken{.watch = 1}, 1));
    }
    return true;
  }

  /// One member loses its connection, or leaves, and comes back as it may.
  void reconnect(Member& member) {
    const auto how = random_() % 10;
    hub_.detach(member.node, how == 0, proto::GoodbyeCode::done);
    member.connected = false;
    settle();
    if (how <= 1) {  // after its GOODBYE, or too late
      pass(milliseconds{hub_.limits.grace_ms + 1});
      if (random_() % 2 == 0) member.token.clear();
    } else {
      pass(milliseconds{random_() % 20});
    }
    come(member);
  }
  void pass(milliseconds time) {
    hub_.now += time;
    settle();
  }

  TestConductor hub_{Placement::spread, near_the_end()};
  std::vector<Member> members_{kNodes};
  std::mt19937_64 random_{7};
  std::int64_t new_ids_ = 0;
};

TEST_F(LongRun, ReconnectsLeaveNothingBehind) {
  for (std::size_t i = 0; i < kNodes; ++i) {
    members_[i].name = "node-" + std::to_string(i);
    come(members_[i]);
  }
  const std::uint64_t reconnects = stress::is_full_size() ? 1'000'000 : 200'000;
  const std::uint64_t look_every = (reconnects - kWarmUp) / 10;
  std::int64_t at_first = 0;
  for (std::uint64_t count = 1; count <= reconnects; ++count) {
    ASSERT_NO_FATAL_FAILURE(reconnect(members_[random_() % kNodes]));
    if (count < kWarmUp || (count - kWarmUp) % look_every != 0) continue;
    pass(milliseconds{hub_.limits.grace_ms + 60'000});  // nobody is away, no index rests
    ASSERT_EQ(hub_.conductor.membership().sessions().all().size(), kNodes);
    ASSERT_FALSE(hub_.conductor.has_garbage());
    const std::int64_t bytes = live_bytes - kBytesOfAnIndex * new_ids_;
    if (at_first == 0) at_first = bytes;
    ASSERT_LE(bytes, at_first + kSlackBytes) << "after " << count << " reconnects";
  }
}

/// However often connections flap within the grace time: what runs out later for each of them is
/// not kept.
TEST_F(LongRun, FlappingWithinTheGraceTimeTakesNoMemory) {
  for (std::size_t i = 0; i < kNodes; ++i) {
    members_[i].name = "node-" + std::to_string(i);
    come(members_[i]);
  }
  std::int64_t at_first = 0;
  for (int flap = 0; flap < 100'000; ++flap) {
    Member& member = members_[random_() % kNodes];
    hub_.detach(member.node);
    ASSERT_NO_FATAL_FAILURE(come(member));
    if (flap == 40'000) at_first = live_bytes;
  }
  EXPECT_LE(live_bytes, at_first + kSlackBytes) << "the grace time is long";
}

}  // namespace
}  // namespace gimnet::hub
