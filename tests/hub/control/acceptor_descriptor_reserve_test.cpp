#include "hub/control/acceptor.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <vector>

namespace gimnet::hub {
namespace {

TEST(DescriptorReserve, KeepsAsManyAsTheLimitSays) {
  Limits limits;
  limits.administrators = 3;
  DescriptorReserve reserve(limits);
  EXPECT_EQ(reserve.kept(), 3u);
  EXPECT_TRUE(reserve.give_up_one());
  EXPECT_EQ(reserve.kept(), 2u);
  limits.administrators = 5;
  reserve.fill();
  EXPECT_EQ(reserve.kept(), 5u);
  limits.administrators = 0;
  reserve.fill();
  EXPECT_EQ(reserve.kept(), 0u);
  EXPECT_FALSE(reserve.give_up_one());
}

TEST(DescriptorReserve, GivesUpWhereThereAreNoneAndTakesBackWhatIsFree) {
  Limits limits;
  limits.administrators = 2;
  DescriptorReserve reserve(limits);
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  const int highest = ::dup(0);
  rlimit none = before;
  none.rlim_cur = static_cast<rlim_t>(highest) + 1;
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  std::vector<int> fill;
  for (int each = ::dup(0); each >= 0; each = ::dup(0)) fill.push_back(each);
  EXPECT_TRUE(reserve.give_up_one());
  const int somebody = ::dup(0);
  EXPECT_GE(somebody, 0);
  reserve.fill();
  EXPECT_EQ(reserve.kept(), 1u) << "none is free";
  ::close(somebody);
  reserve.fill();
  EXPECT_EQ(reserve.kept(), 2u);
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &before), 0);
  for (const int each : fill) ::close(each);
  ::close(highest);
}

}  // namespace
}  // namespace gimnet::hub
