#include "client/nif/frame_appender.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "proto/frame/frame_parser.hpp"
#include "tests/client/nif/support/frames.hpp"

namespace gimnet::nif::test {
namespace {

constexpr std::uint32_t kSelf = (7u << 20) | 5;
constexpr std::uint32_t kReceiver = (7u << 20) | 100;

/// An appender on a queue of its own, and the frames that it made.
struct Appending {
  Appending() { frames.begin_session(kSelf, 65'536); }

  std::vector<proto::FrameView> written() {
    bytes = write_all(queue);
    std::vector<proto::FrameView> views;
    for (std::size_t at = 0; at < bytes.size();) {
      const auto view = proto::parse_frame(std::span(bytes).subspan(at), proto::Origin::node);
      if (!view) {
        ADD_FAILURE() << "no frame at " << at;
        break;
      }
      EXPECT_EQ(view->header.src, kSelf);
      views.push_back(*view);
      at += view->header.frame_size();
    }
    return views;
  }

  SendQueue queue{{}};
  FrameAppender frames{queue};
  std::vector<std::byte> bytes;
};

/// A message that refers to `payload`.
struct Given {
  explicit Given(std::string_view payload, nif_outgoing given = NIF_OUTGOING_INIT)
      : part{payload.data(), payload.size()} {
    if (given.to == 0) given.to = kReceiver;
    given.parts = &part;
    given.part_count = 1;
    EXPECT_FALSE(message.read(given));
  }
  const nif_bytes part;
  Outgoing message;
};

std::string text_of(const proto::FrameView& view) {
  return {reinterpret_cast<const char*>(view.payload.data()), view.payload.size()};
}

TEST(FrameAppender, ASmallMessageIsOneFrameOfTheSizeThatWasAskedFor) {
  Appending to;
  Given given("hello");
  to.frames.append_whole(given.message, std::nullopt);
  EXPECT_EQ(to.queue.unsent_bytes(), FrameAppender::frame_size(given.message, false, 5));
  const auto views = to.written();
  ASSERT_EQ(views.size(), 1u);
  EXPECT_EQ(views[0].header.dst, kReceiver);
  EXPECT_FALSE(views[0].fragment);
  EXPECT_EQ(text_of(views[0]), "hello");
}

TEST(FrameAppender, AWholeMessageWithItsNumberHasAFragmentHeader) {
  Appending to;
  const std::string payload(5'000, 'p');
  Given given(payload);
  to.frames.append_whole(given.message, to.frames.next_number());
  const auto views = to.written();
  ASSERT_EQ(views.size(), 1u);
  ASSERT_TRUE(views[0].fragment);
  EXPECT_EQ(views[0].fragment->message, 1u);
  EXPECT_EQ(views[0].fragment->total, 5'000u);
  EXPECT_EQ(text_of(views[0]), payload);
}

TEST(FrameAppender, PiecesFitTheHubsLargestFrameAndTheWindow) {
  Appending to;
  to.frames.begin_session(kSelf, 10'000);
  const std::string payload(25'000, 'p');
  Given given(payload);
  const std::uint32_t largest = to.frames.piece_max(given.message);
  EXPECT_EQ(largest + proto::kFragmentHeaderSize, 10'000u);
  SendProgress progress{.number = 3, .dst = kReceiver, .windowed = true};
  progress.window = proto::SendWindow(3, 25'000);
  progress.window.on_sent(2'000);  // nothing of it here: only the window's room is smaller
  proto::Fragmenter fragmenter(25'000, largest);
  std::vector<std::uint32_t> sizes;
  std::string sent;
  while (!fragmenter.done() && progress.window.room() > 0) {
    to.frames.append_piece(given.message, progress, fragmenter);
    for (const proto::FrameView& view : to.written()) {
      EXPECT_EQ(view.fragment->message, 3u);
      EXPECT_EQ(view.fragment->offset, sent.size());
      EXPECT_TRUE(view.header.has(proto::kFlagReport)) << "the library wants to know";
      sizes.push_back(static_cast<std::uint32_t>(view.payload.size()));
      sent += text_of(view);
    }
  }
  EXPECT_EQ(sizes, (std::vector<std::uint32_t>{largest, largest, 23'000 - 2 * largest}));
  EXPECT_EQ(progress.window.sent(), 25'000u);
}

TEST(FrameAppender, ALatestMessageTakesThePlaceOfTheOneThatWaits) {
  Appending to;
  nif_outgoing latest = NIF_OUTGOING_INIT;
  latest.kind = NIF_GROUP;
  latest.to = 11;
  latest.policy = NIF_LATEST;
  for (const char* const payload : {"old", "new"}) {
    Given given(payload, latest);
    to.frames.append_whole(given.message, std::nullopt);
  }
  const auto views = to.written();
  ASSERT_EQ(views.size(), 1u);
  EXPECT_EQ(text_of(views[0]), "new");
}

TEST(FrameAppender, FramesOfTheLibraryGoUnderTheOwnId) {
  Appending to;
  to.frames.append_flow(proto::flow::Ping{77, 1});
  proto::FrameHeader header;
  header.src = 99;
  header.dst = kReceiver;
  to.frames.append_frame(frame_of(header, "data"));
  to.frames.append_probe(kReceiver);
  const auto views = to.written();
  ASSERT_EQ(views.size(), 3u);
  EXPECT_EQ(views[0].header.kind, proto::Kind::flow);
  EXPECT_EQ(views[1].header.kind, proto::Kind::taken) << "in the lane before the next one";
  EXPECT_TRUE(views[1].header.has(proto::kFlagReport));
  EXPECT_EQ(views[1].header.dst, kReceiver);
  EXPECT_EQ(text_of(views[2]), "data");
}

TEST(FrameAppender, ALastMessageGoesAgainWhole) {
  for (const std::size_t size : {0u, 5u, 5'000u, 8'193u, 100'000u}) {
    Appending to;
    LastMessage last;
    last.header.kind = proto::Kind::group;
    last.header.dst = 11;
    last.header.flags = proto::kFlagReport;
    last.payload.resize(size, std::byte{'l'});
    to.frames.append_last(last);
    std::size_t sent = 0;
    for (const proto::FrameView& view : to.written()) {
      EXPECT_EQ(view.header.dst, 11u);
      EXPECT_FALSE(view.header.has(proto::kFlagReport)) << "asked for at its first sending";
      EXPECT_EQ(view.fragment.has_value(), size > proto::kPlainMessageMax);
      if (view.fragment) {
        EXPECT_EQ(view.fragment->offset, sent);
        EXPECT_EQ(view.fragment->total, size);
      }
      sent += view.payload.size();
    }
    EXPECT_EQ(sent, size);
  }
}

TEST(AppendedBytes, GrowByTheFramesAndByABurstForWhatIsUrgent) {
  Appending to;
  Given normal("12345");
  to.frames.append_whole(normal.message, std::nullopt);
  const std::uint64_t one = to.frames.appended().value();
  EXPECT_EQ(one, FrameAppender::frame_size(normal.message, false, 5));
  nif_outgoing given = NIF_OUTGOING_INIT;
  given.lane = NIF_REAL_TIME;
  Given urgent("12345", given);
  to.frames.append_whole(urgent.message, std::nullopt);
  EXPECT_EQ(to.frames.appended().value(), one + AppendedBytes::kBurst);
  to.frames.append_flow(proto::flow::Ping{77, 1});
  EXPECT_EQ(to.frames.appended().value(), one + 2 * AppendedBytes::kBurst);
}

}  // namespace
}  // namespace gimnet::nif::test
