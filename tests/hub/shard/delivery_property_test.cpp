// Random operations on two shards, from a seed, against what must hold for any of them: a frame
// reaches only whom it names, at most once, and in the order sent within its stream and lane; the
// ledger is exact after every turn.

#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <random>
#include <set>
#include <sstream>

#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::Kind;
using testing::FakeNode;
using testing::FrameSpec;
using testing::GotFrame;
using testing::HubRig;

constexpr std::size_t kNodes = 7;
constexpr int kOperations = 1'000;

class World {
 public:
  explicit World(std::uint32_t seed) : random_(seed), rig_(2, limits(seed)) {
    for (std::size_t i = 0; i < kNodes; ++i) {
      FakeNode& node = rig_.join(i % 2, {.resume = resumes(i)});
      nodes_.push_back(&node);
    }
    regroup();
  }

  void step() {
    switch (below(12)) {
      case 0:
        return squeeze(*nodes_[below(kNodes)]);
      case 1:
        return cut(below(kNodes));
      case 2:
        return come_back(below(kNodes));
      case 3:
        return check(*nodes_[below(kNodes)], below(2'000));
      case 4:
        return confirm(*nodes_[below(kNodes)]);
      case 5:
        return rig_.pass_ms(below(250));
      case 6:
        return regroup();
      case 7:
        return rig_.turn_shard(below(2));
      default:
        for (std::size_t i = 1 + below(8); i != 0; --i) send(*nodes_[below(kNodes)]);
        if (below(3) != 0) rig_.turn();
    }
  }

  /// Everybody is there, reads, confirms: nothing is left.
  void finish() {
    for (std::size_t i = 0; i < kNodes; ++i) rejoin(i);
    for (int round = 0; round < 50 && (round < 2 || rig_.ledger().queued != 0); ++round) {
      for (FakeNode* node : nodes_) {
        EXPECT_TRUE(connected(*node));
        node->pipe.set_room(MemoryPeer::kAll);
        node->pipe.plan_sends({});
        node->pipe.plan_receives({});
      }
      rig_.settle();
      for (FakeNode* node : nodes_) {
        check(*node, MemoryPeer::kAll);
        confirm(*node);
      }
    }
    rig_.settle();
    EXPECT_GE(sequence_, 500u);
    EXPECT_EQ(rig_.ledger().queued, 0u);
    std::uint64_t got = 0;
    for (const auto& [node, count] : got_) got += count;
    // Without resume, frames that the kernel took and that a broken connection lost count as
    // delivered.
    EXPECT_GE(rig_.ledger().delivered, got);
  }

 private:
  static Limits limits(std::uint32_t seed) {
    Limits limits;
    if (seed % 2 == 0) {
      limits.lane0_bytes = limits.lane1_bytes = limits.lane2_bytes = limits.lane3_bytes = 16 * 1024;
      limits.reserve_bytes = 16 * 1024;
      limits.resume_bytes = 8 * 1024;
      limits.mailbox_entries = 16;
    }
    return limits;
  }
  static bool resumes(std::size_t node) { return node % 3 == 0; }
  std::size_t below(std::size_t bound) { return random_() % bound; }
  bool connected(const FakeNode& node) { return !node.pipe.transport_gone(); }

  void regroup() {
    members_.clear();
    std::vector<FakeNode*> members;
    for (FakeNode* node : nodes_) {
      if (below(2) == 0) members.push_back(node);
    }
    for (const FakeNode* node : members) members_.insert(node->id.value());
    // Frames under way may be fanned out by the old table or the new one.
    for (const FakeNode* node : members) ever_members_.insert(node->id.value());
    rig_.publish_group(1, nodes_[0]->id, members);
  }

  void send(FakeNode& from) {
    if (!connected(from)) return;
    FrameSpec spec;
    spec.lane = static_cast<std::uint8_t>(below(4));
    std::uint32_t dst = nodes_[below(kNodes)]->id.value();
    std::string prefix;
    std::string named = std::to_string(dst);
    switch (below(6)) {
      case 0:
        spec.kind = Kind::broadcast;
        dst = 0xFFFFFFFF;
        named = "all";
        break;
      case 1:
        if (&from != nodes_[0]) return;
        spec.kind = Kind::group;
        dst = HubRig::group(1);
        named = "group";
        break;
      case 2: {
        spec.kind = Kind::list;
        named = "list";
        std::uint32_t count = 0;
        for (const FakeNode* node : nodes_) {
          if (below(2) == 0 && count != 0) continue;
          const std::uint32_t id = node->id.value();
          prefix.append(reinterpret_cast<const char*>(&id), sizeof id);
          named += "," + std::to_string(id);
          ++count;
        }
        dst = count;
        break;
      }
      case 3:
        spec.flags = 3 | proto::kFlagKeyed;
        prefix = "key_____";
        break;
      case 4:
        spec.flags = 2 | proto::kFlagReport;
        break;
      default:
        break;
    }
    std::ostringstream text;
    text << prefix << '|' << from.id.value() << ' ' << named << ' ' << ++sequence_ << ' ';
    text << std::string(below(8) == 0 ? below(9'000) : below(200), '.');
    rig_.send(from, dst, text.str(), spec);
  }

  void squeeze(FakeNode& node) {
    if (!connected(node)) return;
    node.pipe.set_room(below(3) == 0 ? MemoryPeer::kAll : below(6'000));
    std::vector<std::size_t> sends;
    std::vector<std::size_t> receives;
    for (int i = 0; i < 8; ++i) sends.push_back(below(600));
    for (int i = 0; i < 8; ++i) receives.push_back(below(600));
    node.pipe.plan_sends(sends);
    node.pipe.plan_receives(receives);
  }

  void cut(std::size_t index) {
    FakeNode& node = *nodes_[index];
    if (!connected(node) || below(4) != 0) return;
    // The fake node comes back with the count of what it read: bytes that it leaves in the pipe are
    // lost with it.
    node.pipe.reset_after(below(400));
  }

  void come_back(std::size_t index) {
    if (!connected(*nodes_[index]) || below(4) == 0) rejoin(index);
  }

  void rejoin(std::size_t index) {
    FakeNode& node = *nodes_[index];
    check(node, MemoryPeer::kAll);
    rig_.rejoin(node, {.resume = resumes(index)});
    take_frames(node);
  }

  void confirm(FakeNode& node) {
    if (connected(node)) rig_.send_flow(node, proto::flow::Confirm{node.data_frames});
  }

  void check(FakeNode& node, std::size_t bytes) {
    node.read(bytes);
    take_frames(node);
  }

  void take_frames(FakeNode& node) {
    for (const GotFrame& frame : node.frames) check_frame(node, frame);
    node.frames.clear();
    node.control.clear();
  }

  void check_frame(const FakeNode& node, const GotFrame& frame) {
    ++got_[node.id.value()];
    const std::string text = frame.text();
    std::istringstream words(text.substr(text.find('|') + 1));
    std::uint32_t from = 0;
    std::string named;
    std::uint64_t sequence = 0;
    words >> from >> named >> sequence;
    const std::string self = std::to_string(node.id.value());
    EXPECT_EQ(frame.header.src, from);
    if (named == "all") {
      EXPECT_NE(from, node.id.value());
    } else if (named == "group") {
      EXPECT_TRUE(ever_members_.contains(node.id.value()));
    } else if (named.starts_with("list")) {
      EXPECT_NE((named + ",").find("," + self + ","), std::string::npos);
    } else {
      EXPECT_EQ(named, self) << "delivered to another node than addressed";
    }
    std::uint64_t& last =
        last_[{node.id.value(), from, static_cast<std::uint64_t>(frame.header.kind),
               frame.header.flags & 3u, frame.header.lane}];
    EXPECT_GT(sequence, last) << "out of order, or twice";
    last = sequence;
  }

  std::mt19937 random_;
  HubRig rig_;
  std::vector<FakeNode*> nodes_;
  std::set<std::uint32_t> members_;
  std::set<std::uint32_t> ever_members_;
  std::uint64_t sequence_ = 0;
  std::map<std::uint32_t, std::uint64_t> got_;
  std::map<std::array<std::uint64_t, 5>, std::uint64_t> last_;
};

class Delivery : public ::testing::TestWithParam<std::uint32_t> {};

INSTANTIATE_TEST_SUITE_P(Seeds, Delivery, ::testing::Range(0u, 40u));

TEST_P(Delivery, HoldsForRandomOperations) {
  World world(GetParam());
  for (int i = 0; i < kOperations && !HasFailure(); ++i) world.step();
  world.finish();
}

}  // namespace
}  // namespace gimnet::hub
