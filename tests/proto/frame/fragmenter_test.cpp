#include "proto/frame/fragmenter.hpp"

#include <gtest/gtest.h>

namespace gimnet::proto {
namespace {

TEST(Fragmenter, CutsWithoutGapOrOverlap) {
  for (const std::uint32_t total : {1u, 8193u, 32768u, 32769u, 65536u, 1u << 24}) {
    Fragmenter fragmenter(total);
    std::uint32_t offset = 0;
    while (!fragmenter.done()) {
      const Piece piece = fragmenter.next();
      EXPECT_EQ(piece.offset, offset);
      EXPECT_GE(piece.size, 1u);
      EXPECT_LE(piece.size, kFragmentPayload);
      offset += piece.size;
    }
    EXPECT_EQ(offset, total);
  }
}

TEST(Fragmenter, MakesFullPiecesAndARest) {
  Fragmenter fragmenter(kFragmentPayload + 1);
  EXPECT_EQ(fragmenter.next(), (Piece{0, kFragmentPayload}));
  EXPECT_EQ(fragmenter.next(), (Piece{kFragmentPayload, 1}));
  EXPECT_TRUE(fragmenter.done());
}

TEST(Fragmenter, ObeysAWindow) {
  Fragmenter fragmenter(100, 40);
  EXPECT_EQ(fragmenter.next(7), (Piece{0, 7}));
  EXPECT_EQ(fragmenter.next(), (Piece{7, 40}));
  EXPECT_EQ(fragmenter.next(1000), (Piece{47, 40}));
  EXPECT_EQ(fragmenter.next(), (Piece{87, 13}));
}

TEST(Fragmenter, HasNothingOfAnEmptyMessage) { EXPECT_TRUE(Fragmenter(0).done()); }

TEST(Fragmenter, KnowsWhichMessagesNeedTheHeader) {
  EXPECT_FALSE(needs_fragment_header(0));
  EXPECT_FALSE(needs_fragment_header(4096));
  EXPECT_TRUE(needs_fragment_header(4097));
}

TEST(FragmenterDeathTest, RefusesWhatTheProtocolCannotCarry) {
  EXPECT_FALSE(Fragmenter(kMessageBytesMax).done());
  EXPECT_DEATH(Fragmenter(kMessageBytesMax + 1), "broken invariant");
}

}  // namespace
}  // namespace gimnet::proto
