#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <deque>
#include <exception>
#include <string>
#include <thread>
#include <vector>

#include "proto/control/ns.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/statistics.hpp"

// A healthy pair among many others that take all the memory which they can get: slow nodes, absent
// nodes, providers of retained messages, and nodes that come back with resume and take nothing.
// Provable is that the pair loses nothing, and that the hub's memory stays within its budgets.

namespace gimnet::stress {
namespace {

constexpr std::int64_t kMiB = 1 << 20;
/// The bytes of retained messages that the hub keeps beside its budget (retained_budget_bytes).
constexpr std::int64_t kRetainedBudget = 64 * kMiB;

struct Size {
  std::size_t others = 100;
  std::int64_t budget = 32 * kMiB;
  std::uint64_t messages = 5'000;
  std::uint32_t retained_bytes = 200 * 1024;
};
Size size_of_the_run() {
  if (!is_full_size()) return {};
  return {.others = 1'000, .budget = 256 * kMiB, .messages = 60'000, .retained_bytes = 600 * 1024};
}

std::vector<std::string> arguments(std::int64_t budget) {
  // The kernel takes little for a node, so that a healthy one has data waiting at the hub.
  return {"--shards", "2",
          "--limit",  "silent_ms=600000",
          "--limit",  "slow_consumer_ms=600000",
          "--limit",  "grace_ms=600000",
          "--limit",  "socket_send_bytes=16384",
          "--limit",  "mailbox_bytes=1M",
          "--limit",  "budget_bytes=" + std::to_string(budget)};
}

JoinOptions at_shard(std::size_t shard, const std::string& name = "", bool resume = false) {
  JoinOptions options;
  options.hello.name = name;
  options.hello.shard = static_cast<std::uint16_t>(shard);
  options.hello.resume = resume;
  options.hello.epoch = resume ? 1 : 0;
  return options;
}

/// A sender of a thousand messages of 2 KB a second, which waits for nobody, and a receiver that
/// takes them as they come. Of a machine that stands still it proves what can be proved: a message
/// may be lost only if more than the connection's share was under way when it was sent. The sender
/// does not make up for time in which it stood still itself. Thread safety: send() and receive()
/// have a thread each.
class HealthyPair {
 public:
  /// `share_bytes`: the least that the receiver may have waiting.
  HealthyPair(const HubProcess& hub, std::int64_t share_bytes)
      : sender_(hub.unix_url(), at_shard(0)),
        receiver_(hub.unix_url(), at_shard(1)),
        share_(static_cast<std::uint64_t>(share_bytes) / kHeldBytes) {}

  void send(std::uint64_t messages) {
    auto next = Clock::now();
    while (sent_ < messages) {
      for (; Clock::now() >= next && sent_ < messages; next += kPace) {
        next = std::max(next, Clock::now() - kLateMax);
        // So that the receiver knows the end, the last one is never dropped.
        put(sent_ + 1 == messages ? proto::Policy::block : proto::Policy::drop);
      }
      sender_.flush();
      drain(sender_);
      wait_readable({}, 1);
    }
    sender_.flush_all();
  }
  void receive(std::uint64_t messages) {
    const Deadline deadline(std::chrono::seconds(is_full_size() ? 600 : 90));
    while (last_ < messages) {
      deadline.check("messages for the healthy receiver");
      wait_readable({receiver_.descriptor()}, 10);
      take();
    }
  }
  [[nodiscard]] std::uint64_t received() const { return received_; }
  /// Messages that came to a receiver with more than its share under way.
  [[nodiscard]] std::uint64_t beyond_share() const { return beyond_share_; }
  static void drain(RawNode& node) {
    node.read_some();
    while (node.next()) {
    }
  }

 private:
  static constexpr std::chrono::milliseconds kPace{1};
  static constexpr std::chrono::milliseconds kLateMax{5};
  static constexpr std::size_t kPayloadBytes = 2'000;
  /// A message and what the hub needs to keep it in order.
  static constexpr std::uint64_t kHeldBytes = kPayloadBytes + 240;

  void put(proto::Policy policy) {
    std::array<std::byte, kPayloadBytes> payload{};
    if (++sent_ - last_ > share_) ++beyond_share_;
    std::memcpy(payload.data(), &sent_, sizeof sent_);
    sender_.put(parts_of(proto::Kind::unicast, receiver_.id().value(), policy), payload);
  }
  void take() {
    while (receiver_.read_some()) {
      while (const auto frame = receiver_.next()) {
        if (frame->header.kind != proto::Kind::unicast) continue;
        std::uint64_t number = 0;
        std::memcpy(&number, frame->body().data(), sizeof number);
        last_ = number;
        ++received_;
      }
    }
  }

  RawNode sender_;
  RawNode receiver_;
  const std::uint64_t share_;  ///< in messages
  std::uint64_t sent_ = 0;
  std::uint64_t beyond_share_ = 0;
  std::atomic<std::uint64_t> last_{0};  ///< number of the message that came last
  std::uint64_t received_ = 0;
};

/// The others, and those who send to them.
class Others {
 public:
  Others(const HubProcess& hub, const Size& size)
      : hub_(hub),
        size_(size),
        publisher_(hub.unix_url(), at_shard(0, "publisher")),
        sender_(hub.unix_url(), at_shard(0)),
        blocker_(hub.unix_url(), at_shard(1)) {
    stream_ = advertise(publisher_, "stream", false);
    for (std::size_t i = 0; i < size.others / 4; ++i) {
      providers_.emplace_back(hub.unix_url(), at_shard(i % 2, "map" + std::to_string(i)));
      maps_.push_back(advertise(providers_.back(), "map", true));
      add_slow(i);
      absent_.emplace_back(hub.unix_url(), at_shard(i % 2, "absent" + std::to_string(i), true));
      targets_.push_back(absent_.back().id().value());
      absent_.back().close();
      resumed_.emplace_back(hub.unix_url(), at_shard(i % 2, "back" + std::to_string(i), true));
      targets_.push_back(resumed_.back().id().value());
    }
  }

  /// Some of everything; what cannot be written stays for the next round.
  void round() {
    ++round_;
    if (publisher_.unwritten() < kUnwrittenMax) {
      for (int i = 0; i < 4; ++i) put(publisher_, proto::Kind::group, stream_, 8'000);
    }
    if (sender_.unwritten() < kUnwrittenMax) send_to_some();
    if (blocker_.unwritten() < kUnwrittenMax) block_some();
    publish_map(round_ % providers_.size());
    come_back(round_ % resumed_.size());
    slow_[round_ % slow_.size()].read_some(4'096);
    for (RawNode* node : {&publisher_, &sender_, &blocker_}) {
      node->flush();
      HealthyPair::drain(*node);
    }
  }
  [[nodiscard]] std::int64_t retained_bytes() const {
    return std::min(kRetainedBudget,
                    static_cast<std::int64_t>(providers_.size() * size_.retained_bytes));
  }

 private:
  static constexpr std::size_t kUnwrittenMax = 64 * 1024;
  static constexpr std::uint32_t kFragmentBytes = 8'000;

  static std::uint32_t advertise(RawNode& node, const char* name, bool retain) {
    proto::ns::Advertise service;
    service.service = name;
    service.retain = retain;
    return node.ask<proto::ns::AdvertiseAnswer>(proto::Kind::ns, service).group.value();
  }
  void add_slow(std::size_t i) {
    slow_.emplace_back(hub_.unix_url(), at_shard(i % 2));
    for (const std::string& name :
         {std::string("publisher/stream"), "map" + std::to_string(i) + "/map"}) {
      static_cast<void>(slow_.back().ask<proto::ns::SubscribeAnswer>(proto::Kind::ns,
                                                                     proto::ns::Subscribe{name}));
    }
    targets_.push_back(slow_.back().id().value());
  }
  static void put(RawNode& node, proto::Kind kind, std::uint32_t to, std::size_t bytes,
                  proto::Policy policy = proto::Policy::kind_default,
                  proto::Lane lane = proto::Lane::normal) {
    node.put(parts_of(kind, to, policy, lane), std::vector<std::byte>(bytes));
  }
  void send_to_some() {
    constexpr std::array<std::size_t, 4> kBytes{100, 2'000, 8'000, 60'000};
    for (std::size_t i = 0; i < 16; ++i) {
      const std::uint64_t number = ++sent_;
      const auto lane = static_cast<proto::Lane>(number / 3 % proto::kLaneCount);
      put(sender_, proto::Kind::unicast, targets_[number % targets_.size()],
          kBytes[number / targets_.size() % kBytes.size()], proto::Policy::drop, lane);
    }
  }
  void block_some() {
    for (std::size_t i = 0; i < 4; ++i) {
      const std::uint32_t to = targets_[++blocked_ % targets_.size()];
      if (!blocker_.is_paused(proto::Kind::unicast, 1, to))
        put(blocker_, proto::Kind::unicast, to, 4'000, proto::Policy::block);
    }
  }
  void publish_map(std::size_t index) {
    RawNode& provider = providers_[index];
    HealthyPair::drain(provider);
    if (provider.unwritten() == 0) {
      proto::FrameParts parts = parts_of(proto::Kind::group, maps_[index]);
      ++map_;
      for (std::uint32_t offset = 0; offset < size_.retained_bytes; offset += kFragmentBytes) {
        parts.fragment = proto::FragmentHeader{map_, offset, size_.retained_bytes};
        const std::uint32_t bytes = std::min(kFragmentBytes, size_.retained_bytes - offset);
        provider.put(parts, std::vector<std::byte>(bytes));
      }
    }
    provider.flush();
  }
  /// Cut, and back under its session; it never says that it took anything.
  void come_back(std::size_t index) {
    RawNode& node = resumed_[index];
    node.read_some(4'096);
    if (round_ % 4 != 0) return;
    JoinOptions options = at_shard(index % 2, "back" + std::to_string(index), true);
    options.hello.token = node.welcome().token;
    options.hello.resume_epoch = node.welcome().epoch;
    node.close();
    node = RawNode(hub_.unix_url(), options);
  }

  const HubProcess& hub_;
  const Size size_;
  RawNode publisher_;  ///< to all slow ones
  RawNode sender_;     ///< of messages that may be dropped
  RawNode blocker_;    ///< of those sent with BLOCK
  std::deque<RawNode> slow_;
  std::deque<RawNode> absent_;
  std::deque<RawNode> resumed_;
  std::deque<RawNode> providers_;
  std::uint32_t stream_ = 0;
  std::vector<std::uint32_t> maps_;
  std::vector<std::uint32_t> targets_;
  std::uint64_t round_ = 0;
  std::uint64_t sent_ = 0;
  std::uint64_t blocked_ = 0;
  std::uint32_t map_ = 0;
};

TEST(Mixture, AHealthyPairLosesNothing) {
  const Size size = size_of_the_run();
  raise_descriptor_limit();
  const HubProcess hub(arguments(size.budget));
  // A third of the budget for all, of whom the pair, the observer and those who send to the others
  // are six.
  const std::int64_t share = size.budget / 3 / static_cast<std::int64_t>(size.others + 6);
  HealthyPair pair(hub, share);
  Others others(hub, size);
  RawNode observer(hub.unix_url());
  const std::int64_t base = hub.resident_bytes();
  std::atomic<bool> done{false};
  std::array<std::exception_ptr, 2> faults;
  std::thread sending([&] {
    try {
      pair.send(size.messages);
    } catch (...) {
      faults[0] = std::current_exception();
      done.store(true);
    }
  });
  std::thread receiving([&] {
    try {
      pair.receive(size.messages);
    } catch (...) {
      faults[1] = std::current_exception();
    }
    done.store(true);
  });
  std::int64_t highest = base;
  while (!done.load()) {
    others.round();
    highest = std::max(highest, hub.resident_bytes());
    wait_readable({}, 1);
  }
  sending.join();
  receiving.join();
  const Statistics now = Statistics::of(observer);
  for (const std::exception_ptr& fault : faults) {
    if (fault) ADD_FAILURE() << now.text();
    if (fault) std::rethrow_exception(fault);
  }
  EXPECT_GE(pair.received() + pair.beyond_share(), size.messages) << now.text();
  EXPECT_LT(pair.beyond_share(), size.messages / 2) << "the machine stands still too often";
  EXPECT_GT(now["scarce_turns"], 0u) << "the test is too small";
  EXPECT_GT(now["dropped.over_budget"], 0u) << "the test is too small";
  const std::int64_t budgets = size.budget + others.retained_bytes();
  EXPECT_LE(highest - base, budgets + budgets / 10)
      << "base " << base << ", highest " << highest << ", " << now.text();
}

}  // namespace
}  // namespace gimnet::stress
