#include "client/nif/messages_under_way.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "client/nif/error.hpp"
#include "proto/frame/frame_parser.hpp"
#include "tests/client/nif/support/frames.hpp"

namespace gimnet::nif::test {
namespace {

constexpr std::uint32_t kReceiver = (7u << 20) | 100;
constexpr std::uint32_t kOther = (7u << 20) | 101;
constexpr std::uint32_t kGroup = 11;
constexpr std::uint32_t kLarge = 3u << 20;
constexpr std::size_t kHeldMax = 4u << 20;

/// A message of zeros.
struct Large {
  explicit Large(std::uint32_t to = kReceiver, std::uint32_t size = kLarge,
                 nif_kind kind = NIF_UNICAST, std::uint8_t flags = 0)
      : payload(size, '\0'), part{payload.data(), payload.size()} {
    nif_outgoing given = NIF_OUTGOING_INIT;
    given.kind = static_cast<std::uint8_t>(kind);
    given.to = to;
    given.flags = flags;
    given.parts = &part;
    given.part_count = 1;
    EXPECT_FALSE(message.read(given));
    message.set_patient(false);
    progress.dst = to;
    progress.windowed = kind == NIF_UNICAST;
  }
  const std::string payload;
  const nif_bytes part;
  Outgoing message;
  SendProgress progress;
};

/// The sending half without a connection.
struct Sending {
  Sending() { frames.begin_session(1, 65'536); }

  /// It has begun, and its sender gave up at once.
  void hold(Large& large, std::uint32_t number) {
    messages.add(large.message, large.progress);
    messages.begin(large.message, large.progress, number);
    messages.hold(large.message, large.progress, proto::Fragmenter(large.message.size(), 32'768));
    messages.end(large.message, large.progress);
  }
  /// Payload bytes of what may go of the messages that are held.
  std::size_t put_held() {
    std::size_t all = 0;
    for (;;) {
      result = messages.put_held(gate, frames);
      const std::vector<std::byte> bytes = write_all(queue);
      if (bytes.empty()) return all;
      for (std::size_t at = 0; at < bytes.size();) {
        const auto view = proto::parse_frame(std::span(bytes).subspan(at), proto::Origin::node);
        if (!view) throw std::logic_error("no frame");
        all += view->header.kind == proto::Kind::taken ? 0 : view->payload.size();
        at += view->header.frame_size();
      }
      if (result.ended) return all;
    }
  }

  SendQueue queue{{}};
  PauseTable pauses;
  GroupMoves moves;
  SendGate gate{pauses, moves, queue};
  FrameAppender frames{queue};
  MessagesUnderWay messages{kHeldMax};
  MessagesUnderWay::Put result;
};

TEST(MessagesUnderWay, OneOfAStreamAtATime) {
  MessagesUnderWay messages(kHeldMax);
  Large first;
  const Large same;
  const Large other(kOther);
  EXPECT_TRUE(messages.may_begin(first.message));
  messages.add(first.message, first.progress);
  EXPECT_FALSE(messages.may_begin(same.message));
  EXPECT_TRUE(messages.may_begin(other.message));
  messages.end(first.message, first.progress);
  EXPECT_TRUE(messages.may_begin(same.message));
}

TEST(MessagesUnderWay, AMessageThatMayBeHeldNeedsPlaceForItsRest) {
  Sending node;
  Large held;
  node.hold(held, 1);
  Large next(kOther);
  EXPECT_FALSE(node.messages.may_begin(next.message));
  next.message.set_patient(true);
  EXPECT_TRUE(node.messages.may_begin(next.message)) << "its sender waits as long as it takes";
  const Large small(kOther, 8'192);
  EXPECT_TRUE(node.messages.may_begin(small.message)) << "it goes in one frame";
}

TEST(MessagesUnderWay, ATakenOpensTheWindowOfTheMessageThatItIsAbout) {
  MessagesUnderWay messages(kHeldMax);
  Large large;
  messages.add(large.message, large.progress);
  messages.begin(large.message, large.progress, 7);
  large.progress.window.on_sent(proto::kWindowDefault);
  EXPECT_TRUE(large.progress.stalled());
  EXPECT_FALSE(messages.on_taken(kReceiver, {8, 1'000, kLarge}));
  EXPECT_FALSE(messages.on_taken(kOther, {7, 1'000, kLarge}));
  EXPECT_TRUE(large.progress.stalled());
  EXPECT_FALSE(messages.on_taken(kReceiver, {7, 1'000, kLarge}));
  EXPECT_FALSE(large.progress.stalled());
  EXPECT_EQ(messages.check(large.progress), NIF_OK);
}

TEST(MessagesUnderWay, AReceiverRefusesAMessageAtItsBeginningOrGivesItUpLater) {
  MessagesUnderWay messages(kHeldMax);
  Large large;
  messages.add(large.message, large.progress);
  messages.begin(large.message, large.progress, 7);
  static_cast<void>(messages.on_taken(kReceiver, {7, 0, 0}));
  EXPECT_EQ(messages.check(large.progress), NIF_TOO_LARGE);
  Large later(kOther);
  messages.add(later.message, later.progress);
  messages.begin(later.message, later.progress, 8);
  later.progress.window.on_sent(1'000);
  static_cast<void>(messages.on_taken(kOther, {8, 1'000, kLarge}));
  static_cast<void>(messages.on_taken(kOther, {8, 0, 0}));
  EXPECT_EQ(messages.check(later.progress), NIF_NOT_DELIVERED);
}

/// A report of the first fragment of that message to kReceiver.
struct Reported {
  Reported(std::uint32_t number, proto::DropReason reason) : following(proto::kFragmentHeaderSize) {
    proto::store_fragment_header(following.data(), {number, 0, kLarge});
    report.reason = reason;
    report.count = 1;
    report.header.kind = proto::Kind::unicast;
    report.header.dst = kReceiver;
    report.header.lane = static_cast<std::uint8_t>(proto::Lane::normal);
    report.header.flags = proto::kFlagFragment;
    report.following = following;
  }
  std::vector<std::byte> following;
  proto::Report report;
};

TEST(MessagesUnderWay, AReportEndsTheMessageThatItIsAbout) {
  MessagesUnderWay messages(kHeldMax);
  Large large;
  messages.add(large.message, large.progress);
  messages.begin(large.message, large.progress, 7);
  messages.on_report(Reported(6, proto::DropReason::timed_out).report);
  EXPECT_EQ(messages.check(large.progress), NIF_OK);
  messages.on_report(Reported(7, proto::DropReason::queue_full).report);
  messages.on_report(Reported(7, proto::DropReason::cut_message).report);
  EXPECT_EQ(messages.check(large.progress), NIF_NOT_DELIVERED);
  EXPECT_EQ(large.progress.undelivered, proto::DropReason::queue_full)
      << "the rest goes because of its beginning";
}

TEST(MessagesUnderWay, AReportOfTheQuestionEndsAllThatGoesToThatReceiver) {
  MessagesUnderWay messages(kHeldMax);
  Large gone;
  Large there(kOther);
  messages.add(gone.message, gone.progress);
  messages.add(there.message, there.progress);
  proto::Report report;
  report.reason = proto::DropReason::no_such_node;
  report.header.kind = proto::Kind::taken;
  report.header.dst = kReceiver;
  messages.on_report(report);
  EXPECT_EQ(messages.check(gone.progress), NIF_NOT_DELIVERED);
  EXPECT_EQ(messages.check(there.progress), NIF_OK);
}

TEST(MessagesUnderWay, WhatHasBegunIsLostWhenTheCountsBeginAnew) {
  Sending node;
  Large begun;
  Large waiting(kOther);
  Large held(kGroup, kLarge, NIF_GROUP);
  node.messages.add(begun.message, begun.progress);
  node.messages.begin(begun.message, begun.progress, 1);
  node.messages.add(waiting.message, waiting.progress);
  EXPECT_FALSE(node.messages.begin_epoch()) << "their senders hear of it";
  EXPECT_EQ(node.messages.check(begun.progress), NIF_NOT_CONNECTED);
  EXPECT_EQ(node.messages.check(waiting.progress), NIF_OK);
  node.hold(held, 2);
  EXPECT_TRUE(node.messages.begin_epoch()) << "nobody else hears of it";
  EXPECT_FALSE(node.messages.holds_any());
  EXPECT_TRUE(node.messages.may_begin(held.message));
}

TEST(MessagesUnderWay, AHeldMessageGoesOnAsFarAsItsReceiverAllows) {
  Sending node;
  Large large;
  node.hold(large, 7);
  EXPECT_TRUE(node.messages.holds_any());
  EXPECT_EQ(node.messages.held_bytes(), kLarge);
  EXPECT_EQ(node.put_held(), proto::kWindowDefault);
  EXPECT_FALSE(node.result.ended);
  node.messages.ask_for_receivers(node.frames);
  EXPECT_FALSE(node.queue.all_written()) << "is it still there?";
  EXPECT_FALSE(node.messages.on_taken(kReceiver, {7, proto::kWindowDefault, kLarge}));
  EXPECT_EQ(node.put_held(), kLarge - proto::kWindowDefault);
  EXPECT_TRUE(node.result.ended);
  EXPECT_FALSE(node.result.lost);
  EXPECT_FALSE(node.messages.holds_any());
  EXPECT_TRUE(node.messages.may_begin(large.message));
}

TEST(MessagesUnderWay, TheReportOfAHeldMessageThatItsReceiverGaveUpIsForTheProgram) {
  Sending node;
  Large large(kReceiver, kLarge, NIF_UNICAST, NIF_FLAG_REPORT);
  node.hold(large, 7);
  const auto report = node.messages.on_taken(kReceiver, {7, 0, 0});
  ASSERT_TRUE(report);
  EXPECT_EQ(report->reason, proto::DropReason::too_large);
  EXPECT_EQ(node.put_held(), 0u);
  EXPECT_TRUE(node.result.ended);
}

TEST(MessagesUnderWay, TheRestOfAMessageThatItsReceiverRefusedDoesNotGo) {
  Sending node;
  Large refused(kGroup, kLarge, NIF_SERVICE);
  Large taken(kGroup + 1, kHeldMax - kLarge, NIF_SERVICE);
  refused.progress.tag = 5;
  taken.progress.tag = 6;
  node.hold(refused, 7);
  node.hold(taken, 8);
  node.messages.refuse(5);
  const std::size_t before = node.put_held();  // until one has ended
  EXPECT_EQ(before + node.put_held(), kHeldMax - kLarge) << "the other one";
  EXPECT_FALSE(node.messages.holds_any());
  node.messages.add(refused.message, refused.progress);
  node.messages.begin(refused.message, refused.progress, 9);
  EXPECT_EQ(node.messages.check(refused.progress), NIF_OK);
  node.messages.refuse(5);
  EXPECT_EQ(node.messages.check(refused.progress), NIF_TOO_LARGE);
}

TEST(MessagesUnderWay, AHeldMessageIsLostWithItsService) {
  Sending node;
  Large large(kGroup, kLarge, NIF_GROUP);
  node.hold(large, 7);
  node.moves.add({{kGroup, 0}});
  EXPECT_EQ(node.put_held(), 0u);
  EXPECT_TRUE(node.result.ended);
  EXPECT_TRUE(node.result.lost);
}

TEST(MessagesUnderWay, AMessageGoesOnOnceItHasBegun) {
  MessagesUnderWay messages(kHeldMax);
  Large large(kGroup, kLarge, NIF_GROUP);
  const proto::FrameHeader& header = large.message.parts().header;
  EXPECT_FALSE(messages.goes_on(header));
  messages.add(large.message, large.progress);
  EXPECT_FALSE(messages.goes_on(header));
  messages.begin(large.message, large.progress, 7);
  EXPECT_TRUE(messages.goes_on(header));
  static_cast<void>(messages.begin_epoch());
  EXPECT_FALSE(messages.goes_on(header));
}

}  // namespace
}  // namespace gimnet::nif::test
