#include "client/nif/reported_messages.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <string>

#include "proto/frame/frame_builder.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

namespace gimnet::nif::test {
namespace {

constexpr std::uint64_t kKey = 0x0706050403020100;

/// A message that begins with its number, and the REPORT about a fragment of it.
class Sent {
 public:
  explicit Sent(std::uint32_t number, bool keyed = true)
      : text_(std::to_string(number) + std::string(5'000, '.')) {
    part_ = {text_.data(), text_.size()};
    message_.to = kPeerId;
    message_.parts = &part_;
    message_.part_count = 1;
    message_.flags |= NIF_FLAG_REPORT;
    if (keyed) message_.flags |= NIF_FLAG_KEYED;
    message_.key = kKey;
    EXPECT_FALSE(outgoing.read(message_));
    frame_.resize(proto::prefix_size(outgoing.parts()) + proto::kFragmentHeaderSize + 100);
    outgoing.write_frame(frame_, kOwnId, proto::FragmentHeader{number, 300, outgoing.size()}, 300,
                         100, true);
    report.reason = proto::DropReason::queue_full;
    report.count = 1;
    report.header = proto::load_header(frame_.data());
    report.following = std::span(frame_).subspan(proto::kHeaderSize, proto::kReportFollowingMax);
  }
  Sent(const Sent&) = delete;
  Sent& operator=(const Sent&) = delete;

  Outgoing outgoing;
  proto::Report report;

 private:
  std::string text_;
  nif_bytes part_{};
  nif_outgoing message_ = NIF_OUTGOING_INIT;
  std::vector<std::byte> frame_;
};

std::string text_of(const ReportedMessages::Start& start) {
  return {reinterpret_cast<const char*>(start.data()), start.size()};
}

TEST(ReportedMessages, TellsHowTheMessageOfAFragmentBegan) {
  ReportedMessages messages;
  Sent keyed(1);
  Sent plain(2, false);
  EXPECT_FALSE(messages.find(keyed.report)) << "nothing was sent yet";
  messages.remember(1, keyed.outgoing);
  messages.remember(2, plain.outgoing);
  ASSERT_TRUE(messages.find(keyed.report));
  EXPECT_EQ(text_of(*messages.find(keyed.report)),
            std::string("\0\1\2\3\4\5\6\7", 8) + "1...........");
  EXPECT_EQ(text_of(*messages.find(plain.report)), "2...................");
}

TEST(ReportedMessages, OneMoreThanItRemembersReplacesTheFirst) {
  ReportedMessages messages;
  for (std::uint32_t number = 1; number <= ReportedMessages::kMessagesMax; ++number) {
    Sent sent(number);
    messages.remember(number, sent.outgoing);
  }
  EXPECT_TRUE(messages.find(Sent(1).report));
  Sent next(ReportedMessages::kMessagesMax + 1);
  messages.remember(ReportedMessages::kMessagesMax + 1, next.outgoing);
  EXPECT_FALSE(messages.find(Sent(1).report));
  EXPECT_TRUE(messages.find(Sent(2).report));
  EXPECT_TRUE(messages.find(next.report));
}

TEST(ReportedMessages, CountsThoseThatItRemembersAndNotTheirNumbers) {
  ReportedMessages messages;
  for (std::uint32_t i = 0; i < ReportedMessages::kMessagesMax; ++i) {
    Sent sent(1 + 1024 * i);
    messages.remember(1 + 1024 * i, sent.outgoing);
  }
  EXPECT_TRUE(messages.find(Sent(1).report))
      << "between them were others that asked for no reports";
  EXPECT_TRUE(messages.find(Sent(1025).report));
}

TEST(ReportedMessages, NeedsAFragmentHeaderAtItsPlace) {
  ReportedMessages messages;
  Sent sent(1);
  messages.remember(1, sent.outgoing);
  const auto with = [&](auto change) {
    proto::Report report = sent.report;
    change(report);
    return messages.find(report).has_value();
  };
  EXPECT_TRUE(with([](proto::Report&) {}));
  EXPECT_FALSE(with([](proto::Report& r) {
    r.header.flags &= static_cast<std::uint8_t>(~proto::kFlagFragment);
  }));
  EXPECT_FALSE(with([](proto::Report& r) { r.header.flags |= proto::kFlagExt; }));
  EXPECT_FALSE(with([](proto::Report& r) { r.header.kind = proto::Kind::list; }));
  EXPECT_FALSE(with([](proto::Report& r) { r.header.kind = proto::Kind::service; }))
      << "sent as something else";
  EXPECT_FALSE(with([](proto::Report& r) { r.header.dst = kOwnId; })) << "sent to somebody else";
  EXPECT_FALSE(with(
      [](proto::Report& r) { r.following = r.following.first(proto::kFragmentHeaderSize - 1); }));
  EXPECT_TRUE(
      with([](proto::Report& r) { r.following = r.following.first(proto::kFragmentHeaderSize); }));
}

}  // namespace
}  // namespace gimnet::nif::test
