#include "hub/control/state/untold_moves.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr std::uint32_t kViewer = 2;
constexpr std::uint32_t kLogger = 3;

TEST(UntoldMoves, SeveralAreOneFromWhatTheSubscriberKnew) {
  UntoldMoves moves;
  EXPECT_FALSE(moves.of(kViewer));
  moves.on_moved({kViewer}, 11, 1);
  moves.on_moved({kViewer}, 12, 2);
  moves.on_moved({kViewer}, 13, 3);
  const auto untold = moves.of(kViewer);
  ASSERT_TRUE(untold);
  EXPECT_EQ(untold->known, 11u);
  EXPECT_EQ(untold->move, 3u);
  EXPECT_THAT(untold->between, ElementsAre(12, 13));
  EXPECT_FALSE(moves.of(kLogger));
}

TEST(UntoldMoves, EachSubscriberHasItsOwnBeginning) {
  UntoldMoves moves;
  moves.on_moved({kViewer}, 11, 1);
  moves.on_moved({kViewer, kLogger}, 12, 2);
  moves.on_moved({kViewer, kLogger}, 13, 3);
  EXPECT_THAT(moves.of(kViewer)->between, ElementsAre(12, 13));
  EXPECT_EQ(moves.of(kLogger)->known, 12u);
  EXPECT_THAT(moves.of(kLogger)->between, ElementsAre(13));
}

TEST(UntoldMoves, AServiceThatWasWithdrawnMeanwhileHadNoGroup) {
  UntoldMoves moves;
  moves.on_moved({kViewer}, 11, 1);
  moves.on_moved({kViewer}, 0, 2);
  moves.on_moved({kViewer}, 12, 3);
  EXPECT_EQ(moves.of(kViewer)->known, 11u);
  EXPECT_THAT(moves.of(kViewer)->between, ElementsAre(12));
}

TEST(UntoldMoves, EndWithTheLatestThatWasRead) {
  UntoldMoves moves;
  moves.on_moved({kViewer, kLogger}, 11, 1);
  moves.on_moved({kViewer, kLogger}, 12, 2);
  moves.on_read(kViewer, 1);
  ASSERT_TRUE(moves.of(kViewer)) << "it may not know of the second one";
  EXPECT_EQ(moves.of(kViewer)->known, 11u);
  moves.on_read(kViewer, 2);
  EXPECT_FALSE(moves.of(kViewer));
  EXPECT_TRUE(moves.of(kLogger));
  moves.on_read(kLogger, 7);
  EXPECT_TRUE(moves.empty());
  moves.on_read(kLogger, 8);
  moves.on_moved({kViewer}, 13, 3);
  EXPECT_EQ(moves.of(kViewer)->known, 13u);
  EXPECT_THAT(moves.of(kViewer)->between, IsEmpty()) << "those before it were read of";
}

TEST(UntoldMoves, ForgetAndRenumberASubscriber) {
  UntoldMoves moves;
  moves.on_moved({kViewer, kLogger}, 11, 1);
  moves.renumber(kViewer, 9);
  moves.renumber(5, 6);
  EXPECT_FALSE(moves.of(kViewer));
  EXPECT_EQ(moves.of(9)->known, 11u);
  moves.forget(9);
  moves.forget(kLogger);
  EXPECT_TRUE(moves.empty());
}

TEST(UntoldMoves, TellOfTheLatestGroupsOnly) {
  UntoldMoves moves;
  std::uint64_t move = 0;
  moves.on_moved({kViewer}, 100, ++move);
  std::vector<std::uint32_t> all;
  for (std::uint32_t group = 101; all.size() < UntoldMoves::kBetweenMax; ++group) {
    moves.on_moved({kViewer}, group, ++move);
    all.push_back(group);
  }
  EXPECT_EQ(moves.of(kViewer)->between, all);
  moves.on_moved({kViewer}, 200, ++move);
  all.erase(all.begin());
  all.push_back(200);
  EXPECT_EQ(moves.of(kViewer)->between, all);
  EXPECT_EQ(moves.of(kViewer)->known, 100u);
}

}  // namespace
}  // namespace gimnet::hub
