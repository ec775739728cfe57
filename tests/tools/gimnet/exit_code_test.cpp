#include "tools/gimnet/exit_code.hpp"

#include <gtest/gtest.h>

#include <string>

namespace gimnet::tool {
namespace {

/// What a hub answers (src/hub/control/handle/services.cpp, src/hub/control/state/services.cpp).
Failure limit(const char* sentence) { return {Status::limit, std::string("subscribe robot/odom: ") + sentence}; }

TEST(ExitCode, TermsThatALimitForbidsAreWrongArguments) {
  for (const char* sentence : {
           "n of delivery sync(n) must be 1 to 1024; the hub's --limit sync_window bounds it",
           "the window of a subscription must be 1 to 1024; the hub's --limit sync_window bounds it",
           "the depth of a subscription must be 1 to 64; the hub's --limit subscription_depth bounds it",
           "the maximal rate of a subscription must be 0.001 to 1000 Hz; the hub's --limit subscription_rate_hz bounds "
           "it",
       }) {
    EXPECT_EQ(code_of_terms(ExitCode::failed, limit(sentence), true), ExitCode::usage) << sentence;
    EXPECT_EQ(code_of_terms(ExitCode::failed, limit(sentence), false), ExitCode::failed) << "nobody chose them";
    EXPECT_EQ(code_of_terms(ExitCode::interrupted, limit(sentence), true), ExitCode::interrupted) << "it ends anyway";
  }
}

TEST(ExitCode, OtherLimitsHaveNothingToDoWithTheTerms) {
  for (const char* sentence : {
           "all group ids of this hub are in use or resting; try again in a minute",
           "a node may have 1024 subscriptions; end one first, or start the hub with a larger --limit "
           "subscriptions_per_node",
           "a node may have 256 services; end one first, or start the hub with a larger --limit services_per_node",
       }) {
    EXPECT_EQ(code_of_terms(ExitCode::failed, limit(sentence), true), ExitCode::failed) << sentence;
  }
  const Failure other{Status::denied, "not because of --limit sync_window"};
  EXPECT_EQ(code_of_terms(ExitCode::denied, other, true), ExitCode::denied);
}

}  // namespace
}  // namespace gimnet::tool
