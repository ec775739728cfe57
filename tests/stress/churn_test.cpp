#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "proto/control/ns.hpp"
#include "proto/frame/report.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/statistics.hpp"

// Nodes come and go while frames are under way, to one node, to several (LIST), to a service's
// provider (SERVICE) and to its subscribers (GROUP): provable is that a frame reaches nobody but
// those whom its payload names, not even the next one with that node's id, and that the ledger
// agrees with what senders and receivers counted.

namespace gimnet::stress {
namespace {

constexpr std::size_t kBatch = 1'000;
constexpr std::size_t kRecipients = 12;

constexpr std::size_t kListMax = 4;
constexpr std::size_t kSenders = 2;

/// A node as it once was; the next one with that id has another epoch.
struct Address {
  std::uint32_t node = 0;
  std::uint32_t epoch = 0;
  std::uint32_t service = 0;  ///< the group of what it provides, which takes data
};

/// The recipients of a frame, as every frame tells them: these nodes (LIST), this one (UNICAST),
/// the provider of this service (SERVICE), or the subscribers of the sender that owns it (GROUP).
struct Letter {
  proto::Kind kind = proto::Kind::unicast;
  std::uint32_t group = 0;
  std::uint64_t sequence = 0;
  std::array<Address, kListMax> to{};
};

enum class Leaving { goodbye, end_of_stream, reset };

struct Recipient {
  RawNode node;
  std::uint32_t epoch = 0;
  std::uint32_t service = 0;     ///< the group of its own; 0: no answer yet
  std::uint32_t subscribed = 0;  ///< the group of a sender; 0: no answer yet
};

class Churn {
 public:
  explicit Churn(const HubProcess& hub, std::vector<Leaving> leavings)
      : hub_(hub), leavings_(std::move(leavings)) {
    for (std::uint16_t i = 0; i < kSenders; ++i) {
      RawNode& sender =
          senders_.emplace_back(hub_.unix_url(), at_shard(i, "sender-" + std::to_string(i)));
      proto::ns::Advertise news;
      news.service = "news";
      groups_[i] = sender.ask<proto::ns::AdvertiseAnswer>(proto::Kind::ns, news).group.value();
    }
    while (present_.size() < kRecipients) join();
  }

  void run(std::size_t frames) {
    for (std::size_t sent = 0; sent < frames; sent += kBatch) {
      send_batch((sent / kBatch) % senders_.size());
      if (present_.size() < kRecipients) {
        join();
      } else {
        leave(random_() % present_.size());
      }
      turn();
    }
  }

  /// Reads until the hub has nothing left to deliver and everybody has read it. Returns the final
  /// counters.
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
  /// Frames of that kind that somebody got.
  [[nodiscard]] std::uint64_t received(proto::Kind kind) const {
    return received_by_kind_[static_cast<std::size_t>(kind)];
  }
  /// The excess of lists in the ledger: a frame to n nodes has n outcomes, and was accepted once.
  [[nodiscard]] std::uint64_t list_copies() const { return list_copies_; }
  [[nodiscard]] std::uint64_t joins() const { return joins_; }

 private:
  static JoinOptions at_shard(std::uint16_t shard, const std::string& name) {
    JoinOptions options;
    options.hello.shard = shard;
    options.hello.name = name;
    return options;
  }

  void join() {
    auto made = std::make_unique<Recipient>();
    const std::string name = "recipient-" + std::to_string(joins_);
    made->node =
        RawNode(joins_ % 3 == 0 ? hub_.tcp_url() : hub_.unix_url(), at_shard(joins_ % 2, name));
    // In turns to the one sender and to the other, on whatever shard: whoever follows in a slot has
    // another group.
    declare(*made, "sender-" + std::to_string(joins_ / 2 % kSenders) + "/news");
    made->epoch = static_cast<std::uint32_t>(++joins_);
    // Those who have left are written to as well: the latest at each place of this list, present or
    // not.
    addresses_[joins_ % addresses_.size()] = {made->node.id().value(), made->epoch, made->service};
    present_.push_back(std::move(made));
  }

  /// Provides a service, and subscribes to one. What comes before the answers counts like all that
  /// comes later.
  void declare(Recipient& recipient, const std::string& subscribed) {
    proto::ns::Advertise box;
    box.service = "box";
    box.direction = proto::ns::Direction::accepts;
    recipient.node.put(parts_of(proto::Kind::ns, 0), proto::encode(box, kAdvertise));
    recipient.node.put(parts_of(proto::Kind::ns, 0),
                       proto::encode(proto::ns::Subscribe{.name = subscribed}, kSubscribe));
    recipient.node.flush_all();
    const Deadline deadline;
    while (recipient.service == 0 || recipient.subscribed == 0) {
      deadline.check("answers to ADVERTISE and SUBSCRIBE");
      turn();
      take(recipient);
      if (recipient.service == 0 || recipient.subscribed == 0)
        wait_readable({recipient.node.descriptor()}, 10);
    }
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

  void send_batch(std::size_t sender) {
    for (std::size_t i = 0; i < kBatch; ++i) {
      constexpr std::array kKinds{proto::Kind::list, proto::Kind::group, proto::Kind::service};
      const std::uint64_t choice = random_() % 10;  // most are to one node
      send(senders_[sender], groups_[sender],
           choice < kKinds.size() ? kKinds[choice] : proto::Kind::unicast);
    }
    while (!senders_[sender].flush()) turn();
  }

  void send(RawNode& sender, std::uint32_t group, proto::Kind kind) {
    Letter letter{.kind = kind, .group = group, .sequence = ++sent_};
    std::uint32_t dst = group;
    std::vector<NodeId> recipients;
    if (kind == proto::Kind::list) {
      recipients = choose(letter);
      list_copies_ += recipients.size() - 1;
    } else if (kind != proto::Kind::group) {
      letter.to[0] = any_address();
      dst = kind == proto::Kind::service ? letter.to[0].service : letter.to[0].node;
    }
    auto parts = parts_of(kind, dst);
    parts.header.flags |= proto::kFlagReport;
    parts.recipients = recipients;
    sender.put(parts, std::as_bytes(std::span(&letter, 1)));
  }

  Address any_address() {
    const Address address = addresses_[random_() % addresses_.size()];
    return address.node != 0 ? address : addresses_[joins_ % addresses_.size()];
  }

  /// Some of them, each once.
  std::vector<NodeId> choose(Letter& letter) {
    std::vector<NodeId> nodes;
    const std::size_t most = 1 + random_() % kListMax;
    for (std::size_t i = 0; i < most; ++i) {
      const Address address = any_address();
      const NodeId node{address.node};
      if (std::find(nodes.begin(), nodes.end(), node) != nodes.end()) continue;
      letter.to[nodes.size()] = address;
      nodes.push_back(node);
    }
    std::sort(nodes.begin(), nodes.end());
    return nodes;
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
        if (is_data(frame->header.kind)) ++strays_;
      }
    }
  }

  void take(Recipient& recipient) {
    while (recipient.node.read_some()) {
      while (const auto frame = recipient.node.next()) {
        if (frame->header.kind == proto::Kind::ns) take_answer(recipient, *frame);
        if (!is_data(frame->header.kind)) continue;
        if (!is_for(recipient, *frame)) ++strays_;
        ++received_;
        ++received_by_kind_[static_cast<std::size_t>(frame->header.kind)];
      }
    }
  }

  static void take_answer(Recipient& recipient, const Frame& frame) {
    const auto view = proto::split_control(frame.body());
    if (!view || !view->header.is_answer()) return;
    if (view->header.request == kAdvertise) {
      const auto answer = proto::decode_answer<proto::ns::AdvertiseAnswer>(frame.body());
      if (!answer) throw std::runtime_error(answer.error().sentence);
      recipient.service = answer->group.value();
    } else if (view->header.request == kSubscribe) {
      const auto answer = proto::decode_answer<proto::ns::SubscribeAnswer>(frame.body());
      if (!answer) throw std::runtime_error(answer.error().sentence);
      recipient.subscribed = answer->group.value();
    }
  }

  static bool is_data(proto::Kind kind) { return kind < proto::Kind::report; }

  /// Its payload says so, and its header does not say otherwise.
  bool is_for(const Recipient& recipient, const Frame& frame) const {
    Letter letter;
    if (frame.body().size() != sizeof letter) return false;
    std::memcpy(&letter, frame.body().data(), sizeof letter);
    if (letter.kind != frame.header.kind) return false;
    const std::uint32_t id = recipient.node.id().value();
    const auto names = [&](const Address& to) {
      return to.node == id && to.epoch == recipient.epoch;
    };
    switch (letter.kind) {
      case proto::Kind::list:
        return frame.header.dst == 0 && std::any_of(letter.to.begin(), letter.to.end(), names);
      case proto::Kind::group:
        // The answer may be behind the first of them.
        return frame.header.dst == letter.group &&
               (recipient.subscribed == 0 || recipient.subscribed == letter.group);
      case proto::Kind::service:
        return frame.header.dst == recipient.service && names(letter.to[0]);
      default:
        return frame.header.dst == id && names(letter.to[0]);
    }
  }

  static constexpr std::uint16_t kAdvertise = 1;
  static constexpr std::uint16_t kSubscribe = 2;

  const HubProcess& hub_;
  const std::vector<Leaving> leavings_;
  std::mt19937_64 random_{7};
  std::vector<RawNode> senders_;
  std::vector<std::unique_ptr<Recipient>> present_;
  std::vector<std::unique_ptr<Recipient>> leaving_;  ///< what was written to them is still read
  std::array<Address, kRecipients + 4> addresses_{};
  std::array<std::uint32_t, kSenders> groups_{};  ///< by sender
  bool has_resets_ = false;
  std::uint64_t joins_ = 0;
  std::uint64_t left_ = 0;
  std::uint64_t sent_ = 0;
  std::uint64_t received_ = 0;
  std::array<std::uint64_t, 8> received_by_kind_{};
  std::uint64_t list_copies_ = 0;
  std::uint64_t reported_ = 0;
  std::uint64_t strays_ = 0;
};

void expect_every_kind(const Churn& churn, const Statistics& end) {
  for (const proto::Kind kind :
       {proto::Kind::unicast, proto::Kind::list, proto::Kind::group, proto::Kind::service}) {
    EXPECT_GT(churn.received(kind), 0u) << static_cast<int>(kind);
  }
  EXPECT_GT(end["copies"], churn.list_copies()) << "and what groups add";
}

const std::vector<std::string> kTwoShards{"--shards", "2",       "--placement",
                                          "hint",     "--limit", "grace_ms=50"};

std::size_t half_of_all() { return is_full_size() ? 5'000'000 : 500'000; }

TEST(Churn, DeliversToNobodyElseAndTheLedgerIsExact) {
  const HubProcess hub(kTwoShards);
  Churn churn(hub, {Leaving::goodbye, Leaving::end_of_stream});
  churn.run(half_of_all());
  RawNode observer(hub.unix_url());
  const Statistics end = churn.settle(observer);
  EXPECT_EQ(churn.strays(), 0u);
  EXPECT_EQ(end["accepted"], churn.sent());
  expect_every_kind(churn, end);
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
  expect_every_kind(churn, end);
  // Frames that the kernel had taken for a killed node are lost with it.
  EXPECT_GE(end["delivered"], churn.received());
  EXPECT_EQ(end.dropped(), churn.reported());
  EXPECT_TRUE(end.is_balanced()) << end.text();
  EXPECT_GT(churn.joins(), kRecipients + half_of_all() / kBatch / 2 - 10);
}

}  // namespace
}  // namespace gimnet::stress
