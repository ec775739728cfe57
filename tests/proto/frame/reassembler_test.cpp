#include "proto/frame/reassembler.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto {
namespace {

using State = Reassembled::State;
using test::Bytes;
using test::to_bytes;

constexpr FragmentStream kStream{0x00700011, 0x00700012, Kind::unicast, 2};

FragmentStream stream_of(std::uint32_t src, std::uint32_t dst = 0x00700012) {
  return {src, dst, Kind::unicast, 2};
}

std::string text_of(const Reassembled& result) {
  return {reinterpret_cast<const char*>(result.message.data()), result.message.size()};
}

Reassembled take(Reassembler& reassembler, const FragmentHeader& fragment, std::string_view payload,
                 const FragmentStream& stream = kStream) {
  return reassembler.take(stream, fragment, std::as_bytes(std::span(payload)));
}

TEST(Reassembler, PutsAMessageTogether) {
  Reassembler reassembler;
  const auto first = take(reassembler, {9, 0, 6}, "GI");
  EXPECT_EQ(first.state, State::part);
  EXPECT_EQ(first.taken, 2u);
  EXPECT_EQ(reassembler.waiting_bytes(), 2u);
  EXPECT_EQ(take(reassembler, {9, 2, 6}, "Mne").taken, 5u);
  const auto last = take(reassembler, {9, 5, 6}, "t");
  EXPECT_EQ(last.state, State::whole);
  EXPECT_EQ(text_of(last), "GIMnet");
  EXPECT_EQ(last.message.data(), last.storage.data());
  EXPECT_EQ(reassembler.waiting_bytes(), 0u);
  EXPECT_EQ(reassembler.open_messages(), 0u);
  EXPECT_EQ(reassembler.lost_messages(), 0u);
}

TEST(Reassembler, DoesNotCopyAMessageOfOneFragment) {
  Reassembler reassembler;
  const std::string_view payload = "GIMnet";
  const auto whole = take(reassembler, {9, 0, 6}, payload);
  EXPECT_EQ(whole.state, State::whole);
  EXPECT_EQ(static_cast<const void*>(whole.message.data()), payload.data());
  EXPECT_TRUE(whole.storage.empty());
}

TEST(Reassembler, KeepsStreamsApart) {
  Reassembler reassembler;
  const std::vector<FragmentStream> streams = {stream_of(1),
                                               stream_of(2),
                                               stream_of(1, 7),
                                               {1, 0x00700012, Kind::service, 2},
                                               {1, 0x00700012, Kind::unicast, 3}};
  for (const auto& stream : streams)
    EXPECT_EQ(take(reassembler, {9, 0, 4}, "ab", stream).state, State::part);
  EXPECT_EQ(reassembler.open_messages(), streams.size());
  for (const auto& stream : streams)
    EXPECT_EQ(text_of(take(reassembler, {9, 2, 4}, "cd", stream)), "abcd");
}

TEST(Reassembler, LosesAMessageAtAGapAnOverlapOrAnotherTotal) {
  for (const FragmentHeader& wrong : {FragmentHeader{9, 3, 6}, FragmentHeader{9, 1, 6},
                                      FragmentHeader{9, 0, 6}, FragmentHeader{9, 2, 7}}) {
    Reassembler reassembler;
    ASSERT_EQ(take(reassembler, {9, 0, 6}, "GI").state, State::part);
    const auto lost = take(reassembler, wrong, "M");
    EXPECT_EQ(lost.state, State::lost);
    EXPECT_EQ(lost.lost_messages, 1u);
    EXPECT_EQ(reassembler.waiting_bytes(), 0u);
    EXPECT_EQ(take(reassembler, {9, 2, 6}, "Mnet").state, State::lost)
        << "what is left of it is not taken";
    EXPECT_EQ(reassembler.lost_messages(), 1u) << "and counted once";
  }
}

TEST(Reassembler, LosesAMessageWhenAnotherBegins) {
  Reassembler reassembler;
  ASSERT_EQ(take(reassembler, {9, 0, 6}, "GI").state, State::part);
  const auto next = take(reassembler, {10, 0, 4}, "ab");
  EXPECT_EQ(next.state, State::part);
  EXPECT_EQ(next.lost_messages, 1u);
  EXPECT_EQ(text_of(take(reassembler, {10, 2, 4}, "cd")), "abcd");
}

TEST(Reassembler, LosesAMessageOfWhichTheBeginningDidNotCome) {
  Reassembler reassembler;
  EXPECT_EQ(take(reassembler, {9, 2, 6}, "Mn").lost_messages, 1u);
  EXPECT_EQ(take(reassembler, {9, 4, 6}, "et").lost_messages, 0u);
  EXPECT_EQ(take(reassembler, {10, 3, 6}, "net").lost_messages, 1u);
}

TEST(Reassembler, LosesBothWhereAnotherMessageComesWithoutItsBeginning) {
  Reassembler reassembler;
  ASSERT_EQ(take(reassembler, {9, 0, 6}, "GI").state, State::part);
  const auto other = take(reassembler, {10, 2, 6}, "Mn");
  EXPECT_EQ(other.state, State::lost);
  EXPECT_EQ(other.lost_messages, 2u);
}

TEST(Reassembler, RefusesMessagesOverItsLimit) {
  Reassembler reassembler({.message_bytes_max = 6});
  EXPECT_EQ(take(reassembler, {9, 0, 6}, "GI").state, State::part);
  const auto large = take(reassembler, {10, 0, 7}, "GI");
  EXPECT_EQ(large.state, State::too_large);
  EXPECT_EQ(large.lost_messages, 2u) << "the one before it, and itself";
  EXPECT_EQ(reassembler.waiting_bytes(), 0u);
}

TEST(Reassembler, ReservesWhatComesAndNotWhatIsClaimed) {
  Reassembler reassembler(
      {.message_bytes_max = kMessageBytesMax, .waiting_bytes_max = kMessageBytesMax});
  const Bytes some(1000);
  std::uint32_t offset = 0;
  for (int i = 0; i < 100; ++i, offset += 1000) {
    ASSERT_EQ(reassembler.take(kStream, {9, offset, kMessageBytesMax}, some).state, State::part);
  }
  EXPECT_EQ(reassembler.waiting_bytes(), 100'000u);
}

TEST(Reassembler, OfTheSourceWithMostBytesLosesWhatWaitedLongest) {
  Reassembler reassembler({.message_bytes_max = 10, .waiting_bytes_max = 21});
  ASSERT_EQ(take(reassembler, {1, 0, 10}, "aaaaaa", stream_of(1)).state, State::part);
  ASSERT_EQ(take(reassembler, {1, 0, 10}, "bbbb", stream_of(2)).state, State::part);
  ASSERT_EQ(take(reassembler, {2, 0, 10}, "bbbb", stream_of(2, 7)).state, State::part);
  ASSERT_EQ(take(reassembler, {1, 4, 10}, "b", stream_of(2)).state, State::part);
  const auto third = take(reassembler, {1, 0, 10}, "ccccccc", stream_of(3));
  EXPECT_EQ(third.state, State::part);
  EXPECT_EQ(third.lost_messages, 0u);
  EXPECT_EQ(third.displaced, (std::vector<std::uint32_t>{2}));
  EXPECT_EQ(reassembler.waiting_bytes(), 18u);
  EXPECT_EQ(reassembler.lost_messages(), 1u);
  EXPECT_EQ(take(reassembler, {2, 4, 10}, "bbbbbb", stream_of(2, 7)).state, State::lost);
  EXPECT_EQ(text_of(take(reassembler, {1, 7, 10}, "ccc", stream_of(3))), "cccccccccc");
  EXPECT_EQ(text_of(take(reassembler, {1, 6, 10}, "aaaa", stream_of(1))), "aaaaaaaaaa");
}

TEST(Reassembler, RefusesBytesOfASourceThatHasMostOfThem) {
  Reassembler reassembler({.message_bytes_max = 10, .waiting_bytes_max = 12});
  ASSERT_EQ(take(reassembler, {1, 0, 10}, "aaaa", stream_of(1)).state, State::part);
  ASSERT_EQ(take(reassembler, {1, 0, 10}, "bbbb", stream_of(2)).state, State::part);
  const auto refused = take(reassembler, {1, 4, 10}, "bbbbb", stream_of(2));
  EXPECT_EQ(refused.state, State::no_memory);
  EXPECT_EQ(refused.lost_messages, 1u);
  EXPECT_TRUE(refused.displaced.empty());
  EXPECT_EQ(text_of(take(reassembler, {1, 4, 10}, "aaaaaa", stream_of(1))), "aaaaaaaaaa");
}

TEST(Reassembler, RemembersAsManyStreamsAsItMay) {
  Reassembler reassembler({.streams_max = 2});
  ASSERT_EQ(take(reassembler, {1, 0, 4}, "ab", stream_of(1)).state, State::part);
  ASSERT_EQ(take(reassembler, {1, 0, 4}, "ab", stream_of(2)).state, State::part);
  EXPECT_EQ(take(reassembler, {1, 0, 4}, "ab", stream_of(3)).displaced,
            (std::vector<std::uint32_t>{1}));
  EXPECT_EQ(reassembler.open_messages(), 2u);
  EXPECT_EQ(text_of(take(reassembler, {1, 2, 4}, "cd", stream_of(2))), "abcd");
}

TEST(Reassembler, ASourceOfManyStreamsDisplacesNoOther) {
  Reassembler reassembler({.streams_max = 5});
  ASSERT_EQ(take(reassembler, {1, 0, 4}, "ab", stream_of(1)).state, State::part);
  ASSERT_EQ(take(reassembler, {2, 0, 4}, "ab", stream_of(1, 7)).state, State::part);
  for (std::uint32_t i = 0; i < 100; ++i) {
    const auto step = take(reassembler, {i, 0, 4}, "ab", stream_of(9, i));
    EXPECT_EQ(step.displaced.size(), i < 3 ? 0u : 1u);
    for (const std::uint32_t source : step.displaced) EXPECT_EQ(source, 9u);
  }
  EXPECT_EQ(text_of(take(reassembler, {1, 2, 4}, "cd", stream_of(1))), "abcd");
  EXPECT_EQ(text_of(take(reassembler, {2, 2, 4}, "cd", stream_of(1, 7))), "abcd");
}

TEST(Reassembler, IsInterruptedByAnUnfragmentedMessage) {
  Reassembler reassembler;
  EXPECT_EQ(reassembler.interrupt(kStream), 0u);
  ASSERT_EQ(take(reassembler, {9, 0, 6}, "GI").state, State::part);
  EXPECT_EQ(reassembler.interrupt(kStream), 1u);
  EXPECT_EQ(take(reassembler, {9, 2, 6}, "Mnet").state, State::lost);
}

TEST(Reassembler, ForgetsASource) {
  Reassembler reassembler;
  ASSERT_EQ(take(reassembler, {1, 0, 4}, "ab", stream_of(1)).state, State::part);
  ASSERT_EQ(take(reassembler, {2, 0, 4}, "ab", stream_of(1, 7)).state, State::part);
  ASSERT_EQ(take(reassembler, {1, 0, 4}, "ab", stream_of(2)).state, State::part);
  EXPECT_EQ(reassembler.forget(NodeId{1}), 2u);
  EXPECT_EQ(reassembler.open_messages(), 1u);
  EXPECT_EQ(reassembler.clear(), 1u);
  EXPECT_EQ(reassembler.lost_messages(), 3u);
  EXPECT_EQ(reassembler.waiting_bytes(), 0u);
}

TEST(Reassembler, SaysHowFarTheStreamsOfANodeAre) {
  Reassembler reassembler;
  const Bytes piece(10);
  static_cast<void>(reassembler.take(stream_of(1), {4, 5, 100}, piece));  // no beginning came
  static_cast<void>(reassembler.take(stream_of(1), {5, 0, 100}, piece));
  static_cast<void>(reassembler.take(stream_of(2), {6, 0, 100}, piece));
  const auto standings = reassembler.standings(NodeId{1});
  ASSERT_EQ(standings.size(), 1u);
  EXPECT_EQ(standings[0].stream, stream_of(1));
  EXPECT_EQ(standings[0].open, (FragmentHeader{5, 10, 100}));
  EXPECT_EQ(standings[0].lost, 4u);
  EXPECT_EQ(reassembler.standings(std::nullopt).size(), 2u);
  EXPECT_TRUE(reassembler.standings(NodeId{3}).empty());
}

TEST(Reassembler, GivesWhatWasCutHoweverStreamsInterleave) {
  std::mt19937 generator(7);  // NOLINT: the same every time
  const auto below = [&generator](std::uint32_t end) {
    return static_cast<std::uint32_t>(generator()) % end;
  };
  constexpr std::uint32_t kStreams = 5;
  Reassembler reassembler;
  std::vector<Bytes> messages(kStreams);
  std::vector<Fragmenter> fragmenters;
  for (std::uint32_t i = 0; i < kStreams; ++i) {
    messages[i].resize(50'000 + 10'000 * i, static_cast<std::byte>(i));
    fragmenters.emplace_back(static_cast<std::uint32_t>(messages[i].size()), 1000);
  }
  std::uint32_t whole = 0;
  while (whole < kStreams) {
    const std::uint32_t i = below(kStreams);
    if (fragmenters[i].done()) continue;
    const Piece piece = fragmenters[i].next(1 + below(2000));
    const auto result =
        reassembler.take(stream_of(i + 1), {i, piece.offset, fragmenters[i].total()},
                         std::span<const std::byte>(messages[i]).subspan(piece.offset, piece.size));
    if (result.state != State::whole) continue;
    EXPECT_EQ(to_bytes(result.message), messages[i]);
    ++whole;
  }
  EXPECT_EQ(reassembler.lost_messages(), 0u);
}

}  // namespace
}  // namespace gimnet::proto
