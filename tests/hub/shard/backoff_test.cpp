#include "hub/shard/connection.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

namespace gimnet::hub {
namespace {

using ::testing::ElementsAre;

/// Calls that were not made before each of `tries` that were, all of which find nothing.
std::vector<int> pauses_of_failures(Backoff& backoff, int tries) {
  std::vector<int> pauses;
  for (int made = 0; made < tries; ++made) {
    int pause = 0;
    while (!backoff.is_due()) ++pause;
    pauses.push_back(pause);
    backoff.failed();
  }
  return pauses;
}

TEST(Backoff, IsTriedEverMoreRarelyWhileNothingIsFound) {
  Backoff backoff;
  EXPECT_THAT(pauses_of_failures(backoff, 6), ElementsAre(7, 7, 15, 31, 63, 63));
}

TEST(Backoff, IsTriedAlwaysWhileSomethingIsFound) {
  Backoff backoff;
  while (!backoff.is_due()) {
  }
  for (int i = 0; i < 100; ++i) {
    backoff.succeeded();
    EXPECT_TRUE(backoff.is_due());
  }
}

TEST(Backoff, ForgivesOneFailureAmongSuccesses) {
  Backoff backoff;
  backoff.succeeded();
  EXPECT_THAT(pauses_of_failures(backoff, 8), ElementsAre(0, 0, 1, 3, 7, 15, 31, 63));
  backoff.succeeded();
  EXPECT_THAT(pauses_of_failures(backoff, 3), ElementsAre(0, 0, 1))
      << "a success forgets all failures";
}

}  // namespace
}  // namespace gimnet::hub
