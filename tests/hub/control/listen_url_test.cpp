#include "hub/control/listen_url.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

using ::testing::HasSubstr;

TEST(ListenUrl, ReadsWhatItWrites) {
  for (const char* text : {"tcp://127.0.0.1:7450", "tcp://0.0.0.0:0", "tcp://[::1]:65535",
                           "tcp://[::]:1", "unix:/run/tcphub.sock", "unix:/tmp/a"}) {
    const Result<ListenUrl> url = parse_listen_url(text);
    ASSERT_TRUE(url) << text << ": " << url.error().sentence;
    EXPECT_EQ(url->text(), text);
  }
}

TEST(ListenUrl, KnowsOtherSpellings) {
  EXPECT_EQ(parse_listen_url("tcp://localhost:1")->text(), "tcp://127.0.0.1:1");
  EXPECT_EQ(parse_listen_url("unix:///tmp/a")->text(), "unix:/tmp/a");
}

TEST(ListenUrl, KnowsWhatOnlyThisMachineReaches) {
  EXPECT_TRUE(parse_listen_url("tcp://127.0.0.1:1")->is_local());
  EXPECT_TRUE(parse_listen_url("tcp://127.9.9.9:1")->is_local());
  EXPECT_TRUE(parse_listen_url("tcp://[::1]:1")->is_local());
  EXPECT_TRUE(parse_listen_url("unix:/tmp/a")->is_local());
  EXPECT_FALSE(parse_listen_url("tcp://0.0.0.0:1")->is_local());
  EXPECT_FALSE(parse_listen_url("tcp://192.168.0.1:1")->is_local());
  EXPECT_FALSE(parse_listen_url("tcp://[::]:1")->is_local());
}

TEST(ListenUrl, RefusesTheRestWithASentence) {
  for (const char* text :
       {"", "7450", "127.0.0.1:7450", "http://127.0.0.1:1", "tcp://127.0.0.1",
        "tcp://127.0.0.1:", "tcp://127.0.0.1:x", "tcp://127.0.0.1:65536", "tcp://127.0.0.1:-1",
        "tcp://:1", "tcp://robot.local:1", "tcp://::1:1", "tcp://[::1]", "tcp://[127.0.0.1]:1",
        "tcp://127.0.0.1:1/x", "unix:", "unix:relative", "unix:/with space"}) {
    const Result<ListenUrl> url = parse_listen_url(text);
    ASSERT_FALSE(url) << text;
    EXPECT_THAT(url.error().sentence, HasSubstr("cannot listen on " + std::string{text}));
  }
}

TEST(ListenUrl, StrangeBytesAreRefusedAndNotRepeated) {
  using namespace std::string_literals;
  for (const std::string& text : {"unix:/a\nb"s, "unix:/a\x7f"s, "unix:/a\0"s, "tcp:/\n"s,
                                  "tcp://127.0.0.1\0:1"s, "tcp://\x1b[2J:1"s, "tcp://[::1\0]:1"s}) {
    const Result<ListenUrl> url = parse_listen_url(text);
    ASSERT_FALSE(url) << text;
    for (const char c : url.error().sentence)
      EXPECT_TRUE(c >= ' ' && c <= '~') << url.error().sentence;
  }
}

TEST(ListenUrl, SocketPathsFitTheKernelsAndNotOneByteMore) {
  EXPECT_TRUE(parse_listen_url("unix:/" + std::string(kSocketPathMax - 1, 'a')));
  EXPECT_FALSE(parse_listen_url("unix:/" + std::string(kSocketPathMax, 'a')));
}

}  // namespace
}  // namespace gimnet::hub
