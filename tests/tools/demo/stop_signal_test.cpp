#include "tools/demo/stop_signal.hpp"

#include <gtest/gtest.h>

#include <unistd.h>

#include <csignal>

namespace gimnet::demo {
namespace {

TEST(StopSignal, IsRememberedInsteadOfEndingTheProcess) {
  EXPECT_EQ(stop_signal(), 0);
  remember_stop_signals(600);
  ASSERT_EQ(std::raise(SIGPIPE), 0);
  EXPECT_EQ(stop_signal(), 0);
  ASSERT_EQ(std::raise(SIGTERM), 0);
  EXPECT_EQ(stop_signal(), SIGTERM);
}

TEST(StopSignal, EndsAProcessThatDoesNot) {
  const auto stubborn = [] {
    remember_stop_signals(1);
    (void)std::raise(SIGTERM);
    while (true) (void)::pause();
  };
  EXPECT_EXIT(stubborn(), testing::KilledBySignal(SIGALRM), "");
}

}  // namespace
}  // namespace gimnet::demo
