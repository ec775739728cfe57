// Random operations on a paced group of a provider and its subscribers on two shards, from a seed,
// against a model of what each subscriber counted: it has never more messages uncredited than its
// window, gets them in order and once, not more often than its rate, a retained one first; and when
// everything is credited, every window is whole again, whatever was lost on the way.

#include <gtest/gtest.h>

#include <array>
#include <deque>
#include <random>

#include "proto/frame/fragment_header.hpp"
#include "tests/hub/shard/support/counting_subscriber.hpp"
#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::Kind;
using testing::CountingSubscriber;
using testing::FakeNode;
using testing::FrameSpec;
using testing::GotFrame;
using testing::HubRig;

constexpr std::size_t kSubscribers = 6;
constexpr int kOperations = 800;
constexpr std::uint32_t kPieceBytes = 700;

class World {
 public:
  explicit World(std::uint32_t seed)
      : random_(seed),
        rig_(2, limits(seed)),
        retain_(seed % 2 == 1),
        lanes_(seed % 4 == 0 ? 2 : 1) {
    provider_ = &rig_.join(0, {.resume = true});
    for (std::size_t i = 0; i < kSubscribers; ++i) {
      CountingSubscriber& each = subscribers_[i];
      each.checks_repeats = !retain_;
      each.checks_first = lanes_ == 1;
      each.resume = i % 3 == 0;
      constexpr std::uint32_t kWindows[] = {0, 1, 2, 5};
      each.terms.window = kWindows[below(4)];
      each.node = &rig_.join(i % 2, {.resume = each.resume});
    }
    noise_ = &rig_.join(1);
    regroup();
  }

  void step() {
    CountingSubscriber& one = subscribers_[below(kSubscribers)];
    switch (below(18)) {
      case 0:
        return subscribe(one);
      case 1:
        return unsubscribe(one);
      case 2:
        return squeeze(*one.node);
      case 3:
        return cut(one);
      case 4:
        return come_back(one);
      case 5:
      case 6:
        return credit(
            one, below(3) == 0 ? one.ended : one.credited + below(1 + one.ended - one.credited));
      case 7:
        return rig_.pass_ms(below(150));
      case 8:
        return rig_.turn_shard(below(2));
      case 9:
      case 10:
        return read(one, below(4'000));
      case 16:
      case 17:
        for (std::size_t i = below(4); i != 0; --i) make_noise();
        return;
      case 11:
        if (below(12) == 0) regroup();
        return;
      default:
        for (std::size_t i = 1 + below(6); i != 0; --i) publish();
        if (below(3) != 0) rig_.turn();
    }
  }

  /// Everybody is there and credits: each has its whole window, and gets the newest message.
  void finish() {
    while (!pieces_.empty()) write_piece();
    for (CountingSubscriber& each : subscribers_) {
      comfort(*each.node);
      rejoin(each);
      if (!each.subscribed) subscribe(each);
    }
    // Time enough to forget what has no end, too.
    settle();
    settle();
    const std::uint64_t newest = publish_whole();
    settle();
    for (CountingSubscriber& each : subscribers_)
      EXPECT_EQ(each.last[1], newest) << "window " << each.terms.window;
    for (CountingSubscriber& each : subscribers_) {
      if (each.terms.interval_us != 0 || each.terms.window == 0) continue;
      const std::uint64_t before = each.ended;
      for (std::uint32_t i = 0; i < each.terms.window + 1; ++i) publish_whole();
      settle_without_credit();
      EXPECT_EQ(each.ended - before, each.terms.window)
          << "a window leaked, or lets through too many";
      settle();
    }
    EXPECT_EQ(rig_.ledger().queued, 0u);
    EXPECT_EQ(rig_.sum(&ShardCounters::bad_credits), 0u);
  }

 private:
  static Limits limits(std::uint32_t seed) {
    Limits limits;
    limits.resume_bytes = 8 * 1024;
    limits.retained_message_bytes = 8 * 1024;
    if (seed % 3 != 1) {
      limits.lane0_bytes = limits.lane1_bytes = limits.lane2_bytes = limits.lane3_bytes = 16 * 1024;
    }
    if (seed % 3 == 0) limits.mailbox_entries = 16;
    return limits;
  }
  std::size_t below(std::size_t bound) { return random_() % bound; }
  static bool connected(const FakeNode& node) { return !node.pipe.transport_gone(); }
  static void comfort(FakeNode& node) {
    node.pipe.set_room(MemoryPeer::kAll);
    node.pipe.plan_sends({});
    node.pipe.plan_receives({});
  }

  // ---- the conductor's part

  void publish_members() {
    std::vector<FakeNode*> members;
    for (const CountingSubscriber& each : subscribers_) {
      if (each.subscribed) members.push_back(each.node);
    }
    rig_.publish_paced_group(group_, provider_->id, members, retain_);
  }

  void regroup() {
    if (!pieces_.empty()) return;
    if (group_ != 0) {
      settle();
      rig_.withdraw_group(group_);
      for (CountingSubscriber& each : subscribers_) {
        each.known = false;
        rig_.command(each.node->shard.value(),
                     EndPaceCommand{each.node->session, GroupId{HubRig::group(group_)}});
      }
      rig_.command(0, ForgetRetainedCommand{GroupId{HubRig::group(group_)}, provider_->id});
      settle();
    }
    ++group_;
    last_routed_ = 0;
    ends_.clear();
    publish_members();
    for (CountingSubscriber& each : subscribers_) {
      each.ended = each.credited = 0;
      each.fresh = true;
      each.next_offset.clear();
      if (!std::exchange(each.subscribed, false)) continue;
      subscribe(each);
    }
  }

  void subscribe(CountingSubscriber& each) {
    if (!connected(*each.node)) return;
    const bool begins = !std::exchange(each.subscribed, true);
    each.terms.depth = below(2) == 0 ? 1 : 3;
    each.terms.interval_us = below(3) == 0 ? 50'000 : 0;
    each.known = true;
    publish_members();
    rig_.pace(*each.node, group_, each.terms, retain_);
    if (begins) answer(each);
    // Messages that its own shard has not handed over yet may come before the last routed one.
    if (begins) each.repeats_up_to = sequence_;
    if (begins && retain_ && std::exchange(each.fresh, false)) each.first_at_least = last_routed_;
    if (!each.resume && begins) rig_.turn_shard(each.node->shard.value());
  }

  void answer(CountingSubscriber& each) {
    SendControlCommand command;
    command.session = each.node->session;
    command.frame = HubRig::frame(*each.node, each.node->id.value(),
                                  std::string(1, static_cast<char>(++each.number)),
                                  {.kind = Kind::ns, .src = 7u << 20});
    command.answers = 1;
    command.counts = CountsBegin{GroupId{HubRig::group(group_)}, each.number};
    rig_.command(each.node->shard.value(), std::move(command));
  }

  void unsubscribe(CountingSubscriber& each) {
    if (!each.subscribed || below(3) != 0) return;
    rig_.turn_shard(each.node->shard.value());  // it reads the last CREDIT
    each.subscribed = false;
    each.first_at_least = 0;
    publish_members();
    rig_.command(each.node->shard.value(),
                 EndPaceCommand{each.node->session, GroupId{HubRig::group(group_)}});
  }

  // ---- the provider

  struct Piece {
    std::vector<std::byte> frame;
    bool ends = false;
  };

  /// Fills the subscribers' queues, where the oldest goes.
  void make_noise() {
    const auto lane = static_cast<std::uint8_t>(1 + below(lanes_));
    rig_.send(*noise_, 0xFFFFFFFF, std::string(below(6'000), 'n'),
              {.kind = Kind::broadcast, .lane = lane});
    ++noise_frames_;
  }

  void publish() {
    if (!connected(*provider_)) return;
    if (pieces_.empty())
      cut_message(below(4) == 0 ? below(6'000) : below(60),
                  static_cast<std::uint8_t>(1 + below(lanes_)));
    write_piece();
  }

  std::uint64_t publish_whole() {
    cut_message(20, 1);
    while (!pieces_.empty()) write_piece();
    rig_.settle_without_reading();
    return sequence_;
  }

  void cut_message(std::size_t size, std::uint8_t lane) {
    std::string text = std::to_string(++sequence_) + " ";
    text.resize(std::max(size, text.size()), '.');
    FrameSpec spec{.kind = Kind::group, .lane = lane};
    if (text.size() <= kPieceBytes) {
      pieces_.push_back({HubRig::frame(*provider_, HubRig::group(group_), text, spec), true});
      return;
    }
    spec.flags = proto::kFlagFragment;
    const auto number = static_cast<std::uint32_t>(sequence_);
    for (std::uint32_t offset = 0; offset < text.size(); offset += kPieceBytes) {
      std::string payload(proto::kFragmentHeaderSize, '\0');
      proto::store_fragment_header(reinterpret_cast<std::byte*>(payload.data()),
                                   {number, offset, static_cast<std::uint32_t>(text.size())});
      payload += text.substr(offset, kPieceBytes);
      const bool ends = offset + kPieceBytes >= text.size();
      pieces_.push_back({HubRig::frame(*provider_, HubRig::group(group_), payload, spec), ends});
    }
    // Now and then a message has no end.
    if (below(10) == 0 && pieces_.size() > 2) pieces_.pop_back();
  }

  void write_piece() {
    rig_.write(*provider_, pieces_.front().frame);
    ++written_;
    if (pieces_.front().ends) ends_.push_back({written_, sequence_});
    pieces_.pop_front();
    rig_.turn_shard(0);
    // A shard that waits for room in the mailbox of the other one does not read the provider.
    for (; !ends_.empty() && ends_.front().first + noise_frames_ <= rig_.ledger().accepted;
         ends_.pop_front()) {
      last_routed_ = ends_.front().second;
    }
  }

  // ---- the subscribers

  void squeeze(FakeNode& node) {
    if (!connected(node)) return;
    node.pipe.set_room(below(4) == 0 ? MemoryPeer::kAll : below(3'000));
    std::vector<std::size_t> sends;
    for (int i = 0; i < 8; ++i) sends.push_back(below(600));
    node.pipe.plan_sends(sends);
  }

  void cut(CountingSubscriber& each) {
    if (connected(*each.node) && below(3) == 0) each.node->pipe.reset_after(below(300));
  }

  void come_back(CountingSubscriber& each) {
    if (!connected(*each.node) || below(6) == 0) rejoin(each);
  }

  void rejoin(CountingSubscriber& each) {
    FakeNode& node = *each.node;
    read(each, MemoryPeer::kAll);
    // Now and then with a new life, which knows nothing of the frames before.
    if (below(4) == 0) ++each.epoch;
    rig_.rejoin(node, {.resume = each.resume, .epoch = each.epoch});
    ASSERT_TRUE(node.welcome.has_value());
    if (!node.welcome->resumed) {
      each.ended = each.credited = 0;
      each.next_offset.clear();
      each.repeats_up_to = sequence_;
      each.first_at_least = 0;
    }
    take_frames(each);
    if (each.subscribed && each.counted != each.number) answer(each);
    // Words on the broken connection may be lost.
    credit(each, each.credited);
    if (each.resume && connected(node))
      rig_.send_flow(node, proto::flow::Confirm{node.data_frames});
  }

  void credit(CountingSubscriber& each, std::uint64_t total) {
    if (!connected(*each.node) || !each.known || !each.subscribed) return;
    each.credited = std::max(each.credited, total);
    rig_.send_flow(*each.node, proto::flow::Credit{GroupId{HubRig::group(group_)}, each.credited,
                                                   each.counted});
    if (each.resume) rig_.send_flow(*each.node, proto::flow::Confirm{each.node->data_frames});
  }

  void read(CountingSubscriber& each, std::size_t bytes) {
    each.node->read(bytes);
    take_frames(each);
  }

  void take_frames(CountingSubscriber& each) {
    std::size_t next = 0;
    std::size_t next_control = 0;
    for (const Kind kind : each.node->kinds) {
      if (kind == Kind::ns) {
        each.begin_counts(
            static_cast<std::uint8_t>(each.node->control.at(next_control++).text()[0]));
      } else if (kind != Kind::group && kind != Kind::broadcast) {
        ++next_control;
      } else {
        const GotFrame& frame = each.node->frames.at(next++);
        if (frame.header.dst == HubRig::group(group_)) each.take(frame);
      }
    }
    each.node->kinds.clear();
    each.node->frames.clear();
    each.node->control.clear();
  }

  void read_others() {
    for (FakeNode* node : {provider_, noise_}) node->read();
    rig_.send_flow(*provider_, proto::flow::Confirm{provider_->data_frames});
  }

  void settle_without_credit() {
    for (int round = 0; round < 40; ++round) {
      rig_.pass_ms(100);
      read_others();
      for (CountingSubscriber& each : subscribers_) {
        read(each, MemoryPeer::kAll);
        if (each.resume && connected(*each.node)) {
          rig_.send_flow(*each.node, proto::flow::Confirm{each.node->data_frames});
        }
      }
    }
  }

  void settle() {
    for (int round = 0; round < 40; ++round) {
      rig_.pass_ms(100);
      read_others();
      for (CountingSubscriber& each : subscribers_) {
        read(each, MemoryPeer::kAll);
        credit(each, each.ended);
      }
    }
    rig_.pass_ms(200);
  }

  std::mt19937 random_;
  HubRig rig_;
  const bool retain_;
  const std::size_t lanes_;
  FakeNode* provider_ = nullptr;
  FakeNode* noise_ = nullptr;
  std::uint64_t noise_frames_ = 0;
  std::array<CountingSubscriber, kSubscribers> subscribers_;
  std::deque<Piece> pieces_;
  std::uint32_t group_ = 0;
  std::uint64_t sequence_ = 0;
  std::uint64_t last_routed_ = 0;
  std::uint64_t written_ = 0;  ///< frames of the provider
  std::deque<std::pair<std::uint64_t, std::uint64_t>>
      ends_;  ///< of them, those that end a message, with its sequence
};

class Pace : public ::testing::TestWithParam<std::uint32_t> {};
INSTANTIATE_TEST_SUITE_P(Seeds, Pace, ::testing::Range(0u, 60u));

TEST_P(Pace, HoldsForRandomOperations) {
  World world(GetParam());
  for (int i = 0; i < kOperations && !HasFailure(); ++i) world.step();
  if (!HasFailure()) world.finish();
}

}  // namespace
}  // namespace gimnet::hub
