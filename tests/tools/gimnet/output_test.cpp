#include "tools/gimnet/output.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <string>
#include <thread>

namespace gimnet::tool {
namespace {

TEST(Output, GathersUntilItIsFlushed) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  Output output(ends[1]);
  output.write("a");
  output.write("b");
  output.flush();
  std::array<char, 8> bytes{};
  EXPECT_EQ(::read(ends[0], bytes.data(), bytes.size()), 2);
  EXPECT_TRUE(output.ok());
  ::close(ends[0]);
  ::close(ends[1]);
}

TEST(Output, KeepsTheOrderOfSmallAndLarge) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  std::string got;
  std::thread reader([&] {
    std::array<char, 4096> bytes{};
    for (ssize_t count = 0; (count = ::read(ends[0], bytes.data(), bytes.size())) > 0;) {
      got.append(bytes.data(), static_cast<std::size_t>(count));
    }
  });
  const std::string large(300'000, 'x');
  {
    Output output(ends[1]);
    output.write("begin");
    output.write(large);
    output.write("end");
  }
  ::close(ends[1]);
  reader.join();
  ::close(ends[0]);
  EXPECT_EQ(got, "begin" + large + "end");
}

TEST(Output, WaitsForAPipeThatIsFullAndDoesNotBlock) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe2(ends.data(), O_NONBLOCK), 0);
  const int room = ::fcntl(ends[1], F_SETPIPE_SZ, 4096);
  const std::string large(1'000'000, 'x');
  std::size_t got = 0;
  std::thread reader([&] {
    for (int waiting = 0; waiting < room;) static_cast<void>(::ioctl(ends[0], FIONREAD, &waiting));
    std::array<char, 4096> bytes{};
    for (ssize_t count = -1; count != 0;) {
      count = ::read(ends[0], bytes.data(), bytes.size());
      if (count > 0) got += static_cast<std::size_t>(count);
    }
  });
  Output output(ends[1]);
  output.write(large);
  output.flush();
  EXPECT_TRUE(output.ok());
  ::close(ends[1]);
  reader.join();
  ::close(ends[0]);
  EXPECT_EQ(got, large.size());
}

TEST(Output, SaysThatNobodyReads) {
  std::signal(SIGPIPE, SIG_IGN);
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  ::close(ends[0]);
  Output output(ends[1]);
  output.write("x");
  output.flush();
  EXPECT_FALSE(output.ok());
  EXPECT_EQ(output.error(), EPIPE);
  ::close(ends[1]);
}

}  // namespace

namespace {

TEST(ProgressLine, IsSilentWhereThereIsNoTerminal) {
  std::array<int, 2> pipe{};
  ASSERT_EQ(::pipe(pipe.data()), 0);
  std::atomic<int> asked{0};
  {
    const ProgressLine progress(
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

TEST(ProgressLine, RenewsItsLineAtATerminalAndTakesItAway) {
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
    const ProgressLine progress([&] { return std::to_string(++number) + " sent"; }, terminal);
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
