#include "tools/gimnet/progress.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <stdlib.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <string>

namespace gimnet::tool {
namespace {

TEST(Progress, IsSilentWhereThereIsNoTerminal) {
  std::array<int, 2> pipe{};
  ASSERT_EQ(::pipe(pipe.data()), 0);
  std::atomic<int> asked{0};
  {
    const Progress progress(
        [&] {
          ++asked;
          return std::string("x");
        },
        pipe[1]);
  }
  ::close(pipe[1]);
  char letter = 0;
  EXPECT_EQ(::read(pipe[0], &letter, 1), 0);
  EXPECT_EQ(asked, 0);
  ::close(pipe[0]);
}

TEST(Progress, RenewsItsLineAtATerminalAndTakesItAway) {
  const int master = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  ASSERT_GE(master, 0);
  ASSERT_EQ(::grantpt(master), 0);
  ASSERT_EQ(::unlockpt(master), 0);
  const int terminal = ::open(::ptsname(master), O_RDWR | O_NOCTTY | O_CLOEXEC);
  ASSERT_GE(terminal, 0);
  std::string shown;
  const auto read_until = [&](const std::string& wanted) {
    constexpr int kPatienceMs = 60'000;
    pollfd ready{master, POLLIN, 0};
    while (shown.find(wanted) == std::string::npos && ::poll(&ready, 1, kPatienceMs) == 1) {
      std::array<char, 256> bytes{};
      const ssize_t count = ::read(master, bytes.data(), bytes.size());
      if (count <= 0) break;
      shown.append(bytes.data(), static_cast<std::size_t>(count));
    }
    return shown.find(wanted) != std::string::npos;
  };
  {
    std::atomic<int> number{0};
    const Progress progress([&] { return std::to_string(++number) + " sent"; }, terminal);
    EXPECT_TRUE(read_until("\r1 sent\x1b[K"));
    EXPECT_TRUE(read_until("\r2 sent\x1b[K"));
    shown.clear();
  }
  EXPECT_TRUE(read_until("\r\x1b[K"));
  ::close(terminal);
  ::close(master);
}

}  // namespace
}  // namespace gimnet::tool
