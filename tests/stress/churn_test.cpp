#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <map>
#include <memory>
#include <random>
#include <vector>

#include "proto/frame/report.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/statistics.hpp"

// Nodes come and go while frames are under way: provable is that a frame reaches nobody but the node it was addressed
// to, not even the next one with that node's id, and that the ledger agrees with what senders and receivers counted.

namespace gimnet::stress {
namespace {

constexpr std::size_t kBatch = 1'000;
constexpr std::size_t kRecipients = 12;

/// What every frame says about whom it is for.
struct Letter {
  std::uint32_t recipient = 0;
  std::uint32_t epoch = 0;
  std::uint64_t sequence = 0;
};

enum class Leaving { goodbye, end_of_stream, reset };

struct Recipient {
  RawNode node;
  std::uint32_t epoch = 0;
};

class Churn {
 public:
  explicit Churn(const HubProcess& hub, std::vector<Leaving> leavings) : hub_(hub), leavings_(std::move(leavings)) {
    for (std::uint16_t shard = 0; shard < 2; ++shard) senders_.emplace_back(hub_.unix_url(), at_shard(shard));
    while (present_.size() < kRecipients) join();
  }

  void run(std::size_t frames) {
    for (std::size_t sent = 0; sent < frames; sent += kBatch) {
      send_batch(senders_[(sent / kBatch) % senders_.size()]);
      if (present_.size() < kRecipients) {
        join();
      } else {
        leave(random_() % present_.size());
      }
      turn();
    }
  }

  /// Reads until the hub has nothing left to deliver and everybody has read it. Returns the final counters.
  Statistics settle(RawNode& observer) {
    const auto is_settled = [&](const Statistics& now) {
      turn();
      return now["queued"] == 0 && now["accepted"] == sent_ && reported_ >= now.dropped() &&
             (has_resets_ || received_ == now["delivered"]);
    };
    return wait_for(observer, is_settled, "the last frames; sent " + std::to_string(sent_));
  }

  [[nodiscard]] std::uint64_t sent() const { return sent_; }
  [[nodiscard]] std::uint64_t received() const { return received_; }
  [[nodiscard]] std::uint64_t reported() const { return reported_; }
  [[nodiscard]] std::uint64_t strays() const { return strays_; }
  [[nodiscard]] std::uint64_t joins() const { return joins_; }

 private:
  static JoinOptions at_shard(std::uint16_t shard) {
    JoinOptions options;
    options.hello.shard = shard;
    return options;
  }

  void join() {
    auto made = std::make_unique<Recipient>();
    made->node = RawNode(joins_ % 3 == 0 ? hub_.tcp_url() : hub_.unix_url(), at_shard(joins_ % 2));
    made->epoch = static_cast<std::uint32_t>(++joins_);
    // Those who have left are written to as well: the latest at each place of this list, present or not.
    addresses_[joins_ % addresses_.size()] = {made->node.id().value(), made->epoch, 0};
    present_.push_back(std::move(made));
  }

  void leave(std::size_t index) {
    std::unique_ptr<Recipient> gone = std::move(present_[index]);
    present_.erase(present_.begin() + static_cast<std::ptrdiff_t>(index));
    switch (leavings_[left_++ % leavings_.size()]) {
      case Leaving::goodbye:
        gone->node.leave();
        leaving_.push_back(std::move(gone));
        break;
      case Leaving::end_of_stream:
        gone->node.shut_down();
        leaving_.push_back(std::move(gone));
        break;
      case Leaving::reset:
        has_resets_ = true;
        reset_on_close(gone->node.descriptor());
        gone->node.close();
        break;
    }
  }

  void send_batch(RawNode& sender) {
    for (std::size_t i = 0; i < kBatch; ++i) {
      Letter letter = addresses_[random_() % addresses_.size()];
      if (letter.recipient == 0) letter = addresses_[joins_ % addresses_.size()];
      letter.sequence = ++sent_;
      auto parts = parts_of(proto::Kind::unicast, letter.recipient);
      parts.header.flags |= proto::kFlagReport;
      sender.put(parts, std::as_bytes(std::span(&letter, 1)));
    }
    while (!sender.flush()) turn();
  }

  void turn() {
    for (const auto& recipient : present_) take(*recipient);
    for (const auto& recipient : leaving_) take(*recipient);
    std::erase_if(leaving_, [](const auto& recipient) { return recipient->node.is_closed(); });
    for (RawNode& sender : senders_) {
      while (sender.read_some()) {
      }
      while (const auto frame = sender.next()) {
        const auto report = proto::decode_report(frame->body());
        if (frame->header.kind == proto::Kind::report && report) reported_ += report->count;
      }
    }
  }

  void take(Recipient& recipient) {
    while (recipient.node.read_some()) {
      while (const auto frame = recipient.node.next()) {
        if (frame->header.kind != proto::Kind::unicast) continue;
        Letter letter;
        std::memcpy(&letter, frame->body().data(), sizeof letter);
        const std::uint32_t id = recipient.node.id().value();
        if (letter.recipient != id || frame->header.dst != id || letter.epoch != recipient.epoch) ++strays_;
        ++received_;
      }
    }
  }

  const HubProcess& hub_;
  const std::vector<Leaving> leavings_;
  std::mt19937_64 random_{7};
  std::vector<RawNode> senders_;
  std::vector<std::unique_ptr<Recipient>> present_;
  std::vector<std::unique_ptr<Recipient>> leaving_;  ///< what was written to them is still read
  std::array<Letter, kRecipients + 4> addresses_{};
  bool has_resets_ = false;
  std::uint64_t joins_ = 0;
  std::uint64_t left_ = 0;
  std::uint64_t sent_ = 0;
  std::uint64_t received_ = 0;
  std::uint64_t reported_ = 0;
  std::uint64_t strays_ = 0;
};

const std::vector<std::string> kTwoShards{"--shards", "2", "--placement", "hint", "--limit", "grace_ms=50"};

std::size_t half_of_all() { return is_full_size() ? 5'000'000 : 500'000; }

TEST(Churn, DeliversToNobodyElseAndTheLedgerIsExact) {
  const HubProcess hub(kTwoShards);
  Churn churn(hub, {Leaving::goodbye, Leaving::end_of_stream});
  churn.run(half_of_all());
  RawNode observer(hub.unix_url());
  const Statistics end = churn.settle(observer);
  EXPECT_EQ(churn.strays(), 0u);
  EXPECT_EQ(end["accepted"], churn.sent());
  EXPECT_EQ(end["copies"], 0u);
  EXPECT_EQ(end["delivered"], churn.received());
  EXPECT_EQ(end.dropped(), churn.reported());
  EXPECT_TRUE(end.is_balanced()) << end.text();
  EXPECT_GT(end["mailbox_frames"], 0u) << "no frame crossed shards";
  EXPECT_GT(churn.received(), churn.sent() / 4);
}

TEST(Churn, DeliversToNobodyElseWhereNodesAreKilled) {
  const HubProcess hub(kTwoShards);
  Churn churn(hub, {Leaving::reset, Leaving::reset, Leaving::goodbye});
  churn.run(half_of_all());
  RawNode observer(hub.unix_url());
  const Statistics end = churn.settle(observer);
  EXPECT_EQ(churn.strays(), 0u);
  EXPECT_EQ(end["accepted"], churn.sent());
  // What the kernel had taken for a killed node is lost with it.
  EXPECT_GE(end["delivered"], churn.received());
  EXPECT_EQ(end.dropped(), churn.reported());
  EXPECT_TRUE(end.is_balanced()) << end.text();
  EXPECT_GT(churn.joins(), kRecipients + half_of_all() / kBatch / 2 - 10);
}

}  // namespace
}  // namespace gimnet::stress
