#include "hub/data/egress/egress_context.hpp"

#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

void enter_from_another_thread(const OwnerThread& owner) {
  std::thread([&owner] { owner.check_here(); }).join();
}

TEST(OwnerThread, TheFirstMayComeAgain) {
  OwnerThread owner;
  owner.check_here();
  owner.check_here();
}

TEST(OwnerThread, AfterItLetGoAnotherMayCome) {
  OwnerThread owner;
  owner.check_here();
  owner.let_go();
  enter_from_another_thread(owner);
}

#ifdef NDEBUG
TEST(OwnerThread, AReleaseBuildKeepsNothing) { EXPECT_TRUE(std::is_empty_v<OwnerThread>); }
#else
TEST(OwnerThreadDeathTest, AnotherThreadIsStopped) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  OwnerThread owner;
  owner.check_here();
  EXPECT_DEATH(enter_from_another_thread(owner), "broken invariant.*owner_thread");
}
#endif

}  // namespace
}  // namespace gimnet::hub
