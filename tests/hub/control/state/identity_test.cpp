#include "hub/control/state/identity.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace gimnet::hub {
namespace {

TEST(Identity, HasTheTextThatTokensCover) {
  EXPECT_EQ(Identity{}.text(), "unknown");
  EXPECT_EQ(Identity::open().text(), "open");
  EXPECT_EQ(Identity::of_user(0).text(), "uid 0");
  EXPECT_EQ(Identity::of_user(std::numeric_limits<std::uint32_t>::max()).text(), "uid 4294967295");
}

TEST(Identity, IsEqualToItselfAlone) {
  EXPECT_EQ(Identity::of_user(1000), Identity::of_user(1000));
  EXPECT_NE(Identity::of_user(1000), Identity::of_user(100));
  EXPECT_EQ(Identity::open(), Identity::open());
  EXPECT_NE(Identity::open(), Identity::of_user(0));
  EXPECT_NE(Identity::open(), Identity{});
  EXPECT_NE(Identity::of_user(0), Identity{});
}

TEST(Identity, IsThatOfAUserAtAUnixSocketOnly) {
  EXPECT_TRUE(Identity::of_user(0).is_user());
  EXPECT_FALSE(Identity::open().is_user());
  EXPECT_FALSE(Identity{}.is_user());
}

TEST(Rights, AreNoneUnlessTheyWereGiven) { EXPECT_FALSE(Rights{}.administer); }

}  // namespace
}  // namespace gimnet::hub
