#include "hub/config/sources.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <future>

#include "hub/config/toml_file.hpp"
#include "tests/hub/control/support/folder.hpp"

namespace gimnet::hub {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

class ConfigTextTest : public ::testing::Test {
 protected:
  [[nodiscard]] ConfigText read(bool pipes = false) const { return read_config_text(path_, pipes); }
  void make_pipe() const { ASSERT_EQ(::mkfifo(path_.c_str(), 0600), 0); }
  /// An end to write into that needs no reader yet.
  [[nodiscard]] int writer() const { return ::open(path_.c_str(), O_RDWR | O_CLOEXEC); }

  TestFolder folder_;
  std::string path_ = folder_.path("hub.toml");
};

TEST_F(ConfigTextTest, ARegularFileIsReadWhole) {
  std::ofstream(path_) << "shards = 1\n";
  EXPECT_EQ(read().text, "shards = 1\n");
  EXPECT_EQ(read().error, "");
  std::ofstream(path_) << std::string(kConfigBytesMax, '#');
  EXPECT_EQ(read().text.size(), kConfigBytesMax);
  std::ofstream(path_) << std::string(3 * kConfigBytesMax, '#');
  EXPECT_EQ(read().text.size(), kConfigBytesMax + 1) << "one more shows that it is too long";
}

TEST_F(ConfigTextTest, NoFileIsReadAsAnEmptyOne) {
  EXPECT_EQ(read_config_text("/dev/null", false).error, "");
}

TEST_F(ConfigTextTest, WhatIsNoFileIsNamed) {
  EXPECT_THAT(read().error, StartsWith("No such file or directory; give"));
  EXPECT_THAT(read_config_text(folder_.path(""), true).error, StartsWith("it is a folder; give"));
  for (const char* device : {"/dev/zero", "/dev/ptmx"}) {
    EXPECT_THAT(read_config_text(device, true).error, StartsWith("it is a device; give")) << device;
  }
  const int socket = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path_.c_str(), sizeof address.sun_path - 1);
  ASSERT_EQ(::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  EXPECT_THAT(read(true).error, StartsWith("it is a socket; give"));
  ::close(socket);
}

TEST_F(ConfigTextTest, APipeIsNotEvenOpenedWhereItMayNotBeRead) {
  make_pipe();
  const int end = writer();
  ASSERT_EQ(::write(end, "x", 1), 1);
  EXPECT_THAT(read().error, HasSubstr("it is a pipe, which only a hub that starts can read"));
  char left = 0;
  EXPECT_EQ(::read(end, &left, 1), 1) << "what is in it stays";
  ::close(end);
}

TEST_F(ConfigTextTest, APipeIsReadToItsEnd) {
  make_pipe();
  auto text = std::async(std::launch::async, [this] { return read(true); });
  {
    std::ofstream end(path_);  // waits for the reader
    end << "shards = " << std::flush << "1\n";
  }
  const ConfigText got = text.get();
  EXPECT_EQ(got.error, "");
  EXPECT_EQ(got.text, "shards = 1\n");
}

TEST_F(ConfigTextTest, APipeOfAShellThatIsDoneIsRead) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  ASSERT_EQ(::write(ends[1], "a = 1", 5), 5);
  ::close(ends[1]);
  const std::string path = "/dev/fd/" + std::to_string(ends[0]);
  EXPECT_EQ(read_config_text(path, true).text, "a = 1");
  EXPECT_THAT(read_config_text(path, true).error, StartsWith("this pipe is empty"))
      << "by the first reading";
  ::close(ends[0]);
}

TEST_F(ConfigTextTest, AnEndlessPipeIsBounded) {
  make_pipe();
  auto text = std::async(std::launch::async, [this] { return read(true); });
  const int end = ::open(path_.c_str(), O_WRONLY);
  const std::string some(64 * 1024, '#');
  std::size_t written = 0;
  while (written <= kConfigBytesMax) {
    const ssize_t count = ::write(end, some.data(), some.size());
    ASSERT_GT(count, 0);
    written += static_cast<std::size_t>(count);
  }
  EXPECT_EQ(text.get().text.size(), kConfigBytesMax + 1) << "without waiting for its end";
  ::close(end);
}

TEST_F(ConfigTextTest, AnEmptyPipeIsNoConfiguration) {
  make_pipe();
  auto text = std::async(std::launch::async, [this] { return read(true); });
  ::close(::open(path_.c_str(), O_WRONLY));  // waits for the reader
  EXPECT_THAT(text.get().error, StartsWith("this pipe is empty; did"));
}

}  // namespace
}  // namespace gimnet::hub
