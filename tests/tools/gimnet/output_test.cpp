#include "tools/gimnet/output.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <array>
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
}  // namespace gimnet::tool
