#include "hub/control/state_keeper.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "base/log.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;

class StateKeeperTest : public ::testing::Test {
 protected:
  StateKeeperTest() { set_log_level(LogLevel::off); }
  ~StateKeeperTest() override { set_log_level(LogLevel::info); }

  HubState first() {
    HubState state;
    state.boot = 3;
    return state;
  }

  Limits limits_;
  Membership membership_{Sessions::Options{HubId{7}}, limits_};
  std::vector<HubState> kept_;
  std::string error_;
  StateKeeper keeper_{first(), [this](const HubState& state) {
                        kept_.push_back(state);
                        return error_;
                      }};
};

TEST_F(StateKeeperTest, KeepsWhatIsToOutliveTheHubBesideWhatStays) {
  keeper_.keep(membership_, 1s);
  ASSERT_EQ(kept_.size(), 1u);
  EXPECT_EQ(kept_[0].boot, 3u);
  EXPECT_EQ(kept_[0].node_mark, membership_.durable(1s).nodes.mark);
  EXPECT_EQ(kept_[0].nodes_used, membership_.durable(1s).nodes.used);
  EXPECT_EQ(keeper_.state(), kept_[0]);
  EXPECT_EQ(keeper_.again_at(), std::nullopt);
}

TEST_F(StateKeeperTest, TriesAgainAfterASecondAndNotBefore) {
  const std::uint32_t mark = keeper_.state().node_mark;
  error_ = "the disk is full";
  keeper_.keep(membership_, 1s);
  EXPECT_EQ(keeper_.again_at(), 2s);
  EXPECT_EQ(keeper_.state().node_mark, mark) << "what was not kept is not what was kept last";
  keeper_.keep(membership_, 1'999ms);
  EXPECT_EQ(kept_.size(), 1u);
  error_.clear();
  keeper_.keep(membership_, 2s);
  EXPECT_EQ(kept_.size(), 2u);
  EXPECT_EQ(keeper_.again_at(), std::nullopt);
}

TEST_F(StateKeeperTest, WhoIsToldTheOutcomeNeedNotWaitForTheNextTry) {
  error_ = "the disk is full";
  keeper_.keep(membership_, 1s);
  EXPECT_EQ(keeper_.keep_at_once(membership_, 1s), error_);
  EXPECT_EQ(kept_.size(), 2u);
  EXPECT_EQ(keeper_.again_at(), 2s);
  error_.clear();
  EXPECT_EQ(keeper_.keep_at_once(membership_, 1s), "");
  EXPECT_EQ(keeper_.again_at(), std::nullopt);
}

TEST_F(StateKeeperTest, AHubThatKeepsNothingGoesOn) {
  StateKeeper none({}, nullptr);
  none.keep(membership_, 1s);
  EXPECT_EQ(none.keep_at_once(membership_, 1s), "");
  EXPECT_EQ(none.again_at(), std::nullopt);
}

}  // namespace
}  // namespace gimnet::hub
