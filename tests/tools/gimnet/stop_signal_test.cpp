#include "tools/gimnet/stop_signal.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <cstdint>
#include <cstdlib>

namespace gimnet::tool {
namespace {

/// Ends the process with the signal that asked it to stop, after whatever follows the first.
class Stopping {
 public:
  void ask(int signal) {
    ASSERT_EQ(::kill(::getpid(), signal), 0);
    static_cast<void>(stop_.wait_until(INT64_MAX));
  }
  [[noreturn]] static void end_by_second(int signal) {
    ::kill(::getpid(), signal);
    for (;;) ::pause();
  }
  [[nodiscard]] int signal() { return stop_.signal(); }

 private:
  StopSignal stop_;
};

void reset(int signal, void (*action)(int)) { ASSERT_NE(std::signal(signal, action), SIG_ERR); }

TEST(StopSignal, EachAsksToStop) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    const auto ends = [signal] {
      reset(SIGHUP, SIG_DFL);
      Stopping stopping;
      stopping.ask(signal);
      std::_Exit(stopping.signal());
    };
    EXPECT_EXIT(ends(), testing::ExitedWithCode(signal), "");
  }
}

TEST(StopSignal, ASecondOneEndsAtOnce) {
  const auto ends = [] {
    Stopping stopping;
    stopping.ask(SIGINT);
    Stopping::end_by_second(SIGTERM);
  };
  EXPECT_EXIT(ends(), testing::ExitedWithCode(143), "");
}

TEST(StopSignal, OfATerminalThatGoesOneMayHearTwice) {
  const auto ends = [] {
    reset(SIGHUP, SIG_DFL);
    Stopping stopping;
    stopping.ask(SIGHUP);
    ::kill(::getpid(), SIGHUP);  // is taken before the other one, whose number is higher
    Stopping::end_by_second(SIGTERM);
  };
  EXPECT_EXIT(ends(), testing::ExitedWithCode(143), "");
}

TEST(StopSignal, TheEndOfTheTerminalIsIgnoredWhereItWas) {
  const auto ends = [] {
    reset(SIGHUP, SIG_IGN);
    Stopping stopping;
    ::kill(::getpid(), SIGHUP);
    stopping.ask(SIGTERM);
    std::_Exit(stopping.signal());
  };
  EXPECT_EXIT(ends(), testing::ExitedWithCode(SIGTERM), "");
}

}  // namespace
}  // namespace gimnet::tool
