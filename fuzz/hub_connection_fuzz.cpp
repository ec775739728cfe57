// A whole io shard with two admitted nodes, on the in-memory transport: whatever they send, however
// it is split and whenever they read, the ledger is exact, and what comes out is legal frames that
// one of the two wrote. Of a paced group (sync(n), a rate, retain) the one gets from the other
// messages in order, and in the end exactly a window of them. Input: steps of {u8 choice,
// ...}: which node, and bytes that it writes, how its connection behaves, or time; from 16 on, what
// becomes of the paced group.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <utility>
#include <vector>

#include "fuzz/support/paced_counts.hpp"
#include "fuzz/support/shard_world.hpp"
#include "hub/shard/control_frame.hpp"
#include "proto/control/ns.hpp"
#include "proto/frame/frame_builder.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::hub;
using fuzzing::Node;

constexpr std::size_t kStepsMax = 200;
constexpr std::uint32_t kFirstPacedIndex = 2;
constexpr std::uint32_t kPieceBytes = 300;

class PacedWorld final : public fuzzing::ShardWorld {
 public:
  void pace_or_step(fuzz::Choices& input) {
    const std::uint8_t choice = input.byte();
    if (choice < 16) return step(choice, input);
    pace_step(choice, input);
  }
  void check_and_finish() {
    if (paced_index_ != 0) check_pace();
    finish();
  }

 private:
  void on_group_frame(const proto::FrameView& frame) override {
    if (paced_index_ != 0 && frame.header.dst == paced_group().value()) counts_.take(frame);
  }
  void on_new_epoch(const Node& node) override {
    if (paced_index_ == 0 || node.id != node_[1].id) return;
    counts_.begin_epoch();
    counts_.allow_repeats(sequence_);
  }
  void on_answer(const Node& node) override {
    if (node.id != node_[1].id || unread_.empty()) return;
    read_number_ = unread_.front();
    unread_.pop_front();
    counts_.begin_epoch();
  }
  /// An answer that went with the former connection is asked for anew, under another number.
  void on_attach(const Node& node) override {
    if (node.id != node_[1].id || unread_.empty()) return;
    unread_.clear();
    asks_again_ = true;
  }
  void on_welcome(const Node& node) override {
    if (node.id == node_[1].id && std::exchange(asks_again_, false) && subscribed_) answer();
  }

  // ---- the paced group: the conductor's part

  [[nodiscard]] GroupId paced_group() const {
    return make_id<GroupId>(fuzzing::kHub, paced_index_);
  }

  void pace_step(std::uint8_t choice, fuzz::Choices& input) {
    if (paced_index_ == 0 || choice % 16 == 0) begin_group(input.byte());
    switch (choice % 8) {
      case 0:
        break;
      case 1:
        change_terms(input.byte());
        break;
      case 2:
        end_pace();
        break;
      case 3:
        credit(input.byte());
        break;
      case 4:
        read(node_[1]);
        break;
      default:
        publish(choice % 32 >= 16 ? 0 : 2 * std::size_t{input.byte()});
    }
    turn();
  }

  /// Another group in place of the one that there was.
  void begin_group(std::uint8_t how) {
    if (paced_index_ != 0) {
      static_cast<void>(groups_.exchange(paced_index_, nullptr));
      end_pace();
      shard_->send(ForgetRetainedCommand{paced_group(), node_[0].id});
      // No frame of it may be under way to a table that does not know it.
      turn();
    }
    paced_index_ = paced_index_ == 0 ? kFirstPacedIndex : paced_index_ + 1;
    constexpr std::uint32_t kWindows[] = {0, 1, 2, 5};
    terms_ = {kWindows[how & 3], 1, 0};
    retain_ = (how & 4) != 0;
    pieces_.clear();
    counts_.begin();
    publish_members(false);
    if ((how & 8) == 0) begin_pace();
  }

  void publish_members(bool subscribed) {
    GroupMembers& made = *paced_members_.emplace_back(std::make_unique<GroupMembers>());
    made.provider = node_[0].id;
    made.provider_place = {ShardIndex{0}, node_[0].session.slot, node_[0].session.generation};
    made.retain = retain_;
    made.by_shard.resize(1);
    if (subscribed) made.paced_by_shard = {{{node_[1].session.slot, node_[1].session.generation}}};
    static_cast<void>(groups_.exchange(paced_index_, &made));
    subscribed_ = subscribed;
  }

  void begin_pace() {
    // The last one may be the last one that it had.
    const bool begins = !subscribed_;
    if (begins) counts_.allow_repeats(sequence_);
    if (begins) publish_members(true);
    shard_->send(PaceCommand{node_[1].session, paced_group(), terms_, retain_, false, number_});
    if (begins) answer();
    turn();
  }

  /// The counts begin with it.
  void answer() {
    SendControlCommand command;
    command.session = node_[1].session;
    command.frame = control_frame(proto::Kind::ns, node_[1].id, fuzzing::kHub,
                                  proto::encode_answer(proto::ns::SubscribeAnswer{}, 1));
    command.answers = 1;
    command.counts = CountsBegin{paced_group(), ++number_};
    unread_.push_back(number_);
    shard_->send(std::move(command));
  }

  void change_terms(std::uint8_t how) {
    terms_.depth = 1 + (how & 3);
    terms_.interval_us = (how & 4) != 0 ? 50'000u * (1 + (how >> 4)) : 0;
    begin_pace();
  }

  void end_pace() {
    if (!subscribed_) return;
    publish_members(false);
    subscribed_ = false;
    shard_->send(EndPaceCommand{node_[1].session, paced_group()});
    turn();
  }

  // ---- its nodes

  void publish(std::size_t size) {
    if (pieces_.empty()) cut_message(size);
    node_[0].pipe.write(pieces_.front());
    pieces_.pop_front();
  }

  void cut_message(std::size_t size) {
    std::vector<std::byte> content(size + sizeof(fuzz::PacedCounts::Message));
    const fuzz::PacedCounts::Message message{.sequence = ++sequence_};
    const auto bytes = std::as_bytes(std::span{&message, 1});
    if (content.size() > kPieceBytes) {
      std::copy(bytes.begin(), bytes.end(),
                content.end() - static_cast<std::ptrdiff_t>(bytes.size()));
    }
    std::copy(bytes.begin(), bytes.end(), content.begin());
    proto::FrameParts parts;
    parts.header.kind = proto::Kind::group;
    parts.header.dst = paced_group().value();
    parts.header.src = node_[0].id.value();
    parts.header.lane = 1;
    const auto total = static_cast<std::uint32_t>(content.size());
    for (std::uint32_t offset = 0; offset < total; offset += kPieceBytes) {
      const std::span<const std::byte> piece = std::span{content}.subspan(offset).first(
          std::min<std::size_t>(kPieceBytes, total - offset));
      if (total > kPieceBytes) {
        parts.fragment =
            proto::FragmentHeader{static_cast<std::uint32_t>(sequence_), offset, total};
      }
      std::vector<std::byte> frame(proto::kPrefixSizeMax + piece.size());
      frame.resize(proto::write_frame(parts, piece, frame));
      pieces_.push_back(std::move(frame));
    }
  }

  void flow(Node& node, const proto::flow::Message& message) {
    std::byte frame[proto::flow::kFrameSizeMax];
    const std::size_t size = proto::flow::encode_frame(message, node.id, frame);
    node.pipe.write(std::span{frame}.first(size));
  }

  /// 255: more than there was.
  void credit(std::uint8_t messages) {
    // It has read WELCOME, by which it knows from where it counts.
    read(node_[1]);
    if (!node_[1].welcomed) return;
    const std::uint64_t total = counts_.credit(messages);
    flow(node_[1],
         proto::flow::Credit{paced_group(), total + (messages == 255 ? 1'000 : 0), read_number_});
  }

  // ---- in the end

  /// Everything that is there is read and, if so, credited; time passes.
  void settle(bool with_credit) {
    for (int round = 0; round < 12; ++round) {
      now_ms_ += 100;
      for (Node& node : node_) {
        read(node);
        flow(node, proto::flow::Confirm{node.taken});
      }
      if (with_credit) credit(254);
      turn();
    }
    for (Node& node : node_) read(node);
  }

  /// On new connections the window is whole, the rate is kept, and who comes late gets the last
  /// message.
  void check_pace() {
    for (Node& node : node_) attach(node, false);
    pieces_.clear();
    terms_.depth = 1;
    terms_.interval_us = 0;
    begin_pace();
    // Long enough for what has no end to be given up, which the next message finds out.
    settle(true);
    settle(true);
    publish(0);
    settle(true);
    FUZZ_MUST(counts_.last() == sequence_);
    check_window();
    check_rate();
    check_retained();
  }

  void check_window() {
    if (terms_.window == 0) return;
    const std::uint64_t before = counts_.taken();
    for (std::uint32_t i = 0; i < terms_.window + 1; ++i) publish(0);
    settle(false);
    FUZZ_MUST(counts_.taken() - before == terms_.window);
    settle(true);
    FUZZ_MUST(counts_.taken() - before == terms_.window + 1 && counts_.last() == sequence_);
  }

  void check_rate() {
    const std::uint64_t before = counts_.taken();
    terms_.interval_us = 10'000'000;
    begin_pace();
    for (int i = 0; i < 3; ++i) publish(0);
    settle(true);
    // The first may count as one that was due before, up to one interval: then the next follows at
    // once. Or the last one of an earlier rate was less than an interval ago: then the newest comes
    // when that is over.
    FUZZ_MUST(counts_.taken() - before <= 2);
    for (int i = 0; i < 9 && counts_.last() != sequence_; ++i) settle(true);
    FUZZ_MUST(counts_.last() == sequence_);
    terms_.interval_us = 0;
    begin_pace();
  }

  void check_retained() {
    settle(true);
    end_pace();
    publish(0);
    settle(true);
    const std::uint64_t before = counts_.taken();
    begin_pace();
    settle(true);
    FUZZ_MUST(counts_.taken() - before == (retain_ ? 1 : 0));
    if (retain_) FUZZ_MUST(counts_.last() == sequence_);
  }

  std::vector<std::unique_ptr<GroupMembers>> paced_members_;
  std::uint32_t paced_index_ = 0;  ///< 0: there is none yet
  PaceTerms terms_;
  bool retain_ = false;
  bool subscribed_ = false;
  std::uint8_t number_ = 0;          ///< of its counts
  std::deque<std::uint8_t> unread_;  ///< numbers in answers that the node has not read
  bool asks_again_ = false;
  std::uint8_t read_number_ = 0;  ///< of the last answer that it has
  fuzz::PacedCounts counts_;
  std::deque<std::vector<std::byte>> pieces_;  ///< of the message that is being written
  std::uint64_t sequence_ = 0;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Choices input(fuzz::input(data, size));
  PacedWorld world;
  for (std::size_t steps = 0; input.left() && steps < kStepsMax; ++steps) world.pace_or_step(input);
  world.check_and_finish();
  return 0;
}
