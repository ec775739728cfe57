#include "hub/control/state/untold_moves.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr NodeIndex kViewer{2};
constexpr NodeIndex kLogger{3};

TEST(UntoldMoves, SeveralAreOneFromWhatTheSubscriberKnew) {
  UntoldMoves moves;
  EXPECT_FALSE(moves.of(kViewer));
  moves.on_moved({kViewer}, GroupIndex{11}, 1);
  moves.on_moved({kViewer}, GroupIndex{12}, 2);
  moves.on_moved({kViewer}, GroupIndex{13}, 3);
  const auto untold = moves.of(kViewer);
  ASSERT_TRUE(untold);
  EXPECT_EQ(untold->known, GroupIndex{11});
  EXPECT_EQ(untold->move, 3u);
  EXPECT_THAT(untold->between, ElementsAre(GroupIndex{12}, GroupIndex{13}));
  EXPECT_FALSE(moves.of(kLogger));
}

TEST(UntoldMoves, EachSubscriberHasItsOwnBeginning) {
  UntoldMoves moves;
  moves.on_moved({kViewer}, GroupIndex{11}, 1);
  moves.on_moved({kViewer, kLogger}, GroupIndex{12}, 2);
  moves.on_moved({kViewer, kLogger}, GroupIndex{13}, 3);
  EXPECT_THAT(moves.of(kViewer)->between, ElementsAre(GroupIndex{12}, GroupIndex{13}));
  EXPECT_EQ(moves.of(kLogger)->known, GroupIndex{12});
  EXPECT_THAT(moves.of(kLogger)->between, ElementsAre(GroupIndex{13}));
}

TEST(UntoldMoves, AServiceThatWasWithdrawnMeanwhileHadNoGroup) {
  UntoldMoves moves;
  moves.on_moved({kViewer}, GroupIndex{11}, 1);
  moves.on_moved({kViewer}, kNoGroup, 2);
  moves.on_moved({kViewer}, GroupIndex{12}, 3);
  EXPECT_EQ(moves.of(kViewer)->known, GroupIndex{11});
  EXPECT_THAT(moves.of(kViewer)->between, ElementsAre(GroupIndex{12}));
}

TEST(UntoldMoves, EndWithTheLatestThatWasRead) {
  UntoldMoves moves;
  moves.on_moved({kViewer, kLogger}, GroupIndex{11}, 1);
  moves.on_moved({kViewer, kLogger}, GroupIndex{12}, 2);
  moves.on_read(kViewer, 1);
  ASSERT_TRUE(moves.of(kViewer)) << "it may not know of the second one";
  EXPECT_EQ(moves.of(kViewer)->known, GroupIndex{11});
  moves.on_read(kViewer, 2);
  EXPECT_FALSE(moves.of(kViewer));
  EXPECT_TRUE(moves.of(kLogger));
  moves.on_read(kLogger, 7);
  EXPECT_TRUE(moves.empty());
  moves.on_read(kLogger, 8);
  moves.on_moved({kViewer}, GroupIndex{13}, 3);
  EXPECT_EQ(moves.of(kViewer)->known, GroupIndex{13});
  EXPECT_THAT(moves.of(kViewer)->between, IsEmpty()) << "those before it were read of";
}

TEST(UntoldMoves, ForgetAndRenumberASubscriber) {
  UntoldMoves moves;
  moves.on_moved({kViewer, kLogger}, GroupIndex{11}, 1);
  moves.renumber(kViewer, NodeIndex{9});
  moves.renumber(NodeIndex{5}, NodeIndex{6});
  EXPECT_FALSE(moves.of(kViewer));
  EXPECT_EQ(moves.of(NodeIndex{9})->known, GroupIndex{11});
  moves.forget(NodeIndex{9});
  moves.forget(kLogger);
  EXPECT_TRUE(moves.empty());
}

TEST(UntoldMoves, TellOfTheLatestGroupsOnly) {
  UntoldMoves moves;
  std::uint64_t move = 0;
  moves.on_moved({kViewer}, GroupIndex{100}, ++move);
  std::vector<GroupIndex> all;
  for (std::uint32_t group = 101; all.size() < UntoldMoves::kBetweenMax; ++group) {
    moves.on_moved({kViewer}, GroupIndex{group}, ++move);
    all.emplace_back(group);
  }
  EXPECT_EQ(moves.of(kViewer)->between, all);
  moves.on_moved({kViewer}, GroupIndex{200}, ++move);
  all.erase(all.begin());
  all.emplace_back(200);
  EXPECT_EQ(moves.of(kViewer)->between, all);
  EXPECT_EQ(moves.of(kViewer)->known, GroupIndex{100});
}

}  // namespace
}  // namespace gimnet::hub
