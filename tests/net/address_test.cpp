#include "net/address.hpp"

#include <gtest/gtest.h>

#include <string>

namespace gimnet::net {
namespace {

TEST(Address, ReadsUrlsAndWritesThemBack) {
  for (const char* const url :
       {"tcp://127.0.0.1:7450", "tcp://robot.local:1", "tcp://[::1]:65535", "unix:/run/hub"}) {
    const auto address = parse_address(url);
    ASSERT_TRUE(address) << url;
    EXPECT_EQ(address->url(), url);
  }
  EXPECT_EQ(parse_address("tcp://[::1]:5")->host, "::1");
}

TEST(Address, RefusesWhatItDoesNotUnderstand) {
  for (const char* const url :
       {"", "tcp:", "tcp://", "tcp://host", "tcp://host:", "tcp://host:0", "tcp://host:65536",
        "tcp://host:7x", "tcp://:7450", "unix:", "http://host:80", "host:7450", "tcp://[::1:7450",
        "tcp://::1]:7450"}) {
    const auto address = parse_address(url);
    ASSERT_FALSE(address) << url;
    EXPECT_EQ(address.error().fault, Fault::bad_address);
    EXPECT_NE(address.error().sentence.find(std::string("'") + url + "'"), std::string::npos);
  }
}

TEST(Address, ToListenOnMayLeaveThePortToTheSystem) {
  EXPECT_EQ(parse_address("tcp://127.0.0.1:0", 0)->port, 0);
  const auto wrong = parse_address("tcp://127.0.0.1:port", 0);
  ASSERT_FALSE(wrong);
  EXPECT_NE(wrong.error().sentence.find("the port is not a number from 0 to 65535"),
            std::string::npos);
}

TEST(Address, SaysWhatWasMeant) {
  const auto said = [](const char* url) { return parse_address(url).error().sentence; };
  EXPECT_TRUE(said("127.0.0.1:7450").ends_with("; did you mean tcp://127.0.0.1:7450?"));
  EXPECT_TRUE(said("tcp:/127.0.0.1:7450").ends_with("; did you mean tcp://127.0.0.1:7450?"));
  EXPECT_TRUE(said("/run/hub").ends_with("; did you mean unix:/run/hub?"));
  EXPECT_TRUE(said("http:/h:1").ends_with("; give tcp://host:port or unix:/path"))
      << said("http:/h:1");
  EXPECT_TRUE(said("tcp:/").ends_with("; give tcp://host:port or unix:/path")) << said("tcp:/");
}

TEST(Address, TakesUnixPathsUpToWhatTheSystemTakes) {
  const std::string longest = "/" + std::string(kSocketPathMax - 1, 'p');
  EXPECT_TRUE(parse_address("unix:" + longest));
  EXPECT_FALSE(parse_address("unix:" + longest + "p"));
}

TEST(Address, SuggestsTheSchemeThatIsMissing) {
  EXPECT_NE(
      parse_address("localhost:7450").error().sentence.find("did you mean tcp://localhost:7450?"),
      std::string::npos);
  EXPECT_NE(parse_address("localhost").error().sentence.find("give tcp://host:port"),
            std::string::npos);
}

TEST(Address, AHostIsOnePrintableWord) {
  for (const char* url : {"tcp://a b:1", "tcp://a\r\nX-Evil: 1:1", "tcp://a\x7f:1"}) {
    const auto address = parse_address(url);
    ASSERT_FALSE(address) << url;
    EXPECT_NE(address.error().sentence.find("the host has blanks or control characters"),
              std::string::npos);
  }
}

}  // namespace
}  // namespace gimnet::net
