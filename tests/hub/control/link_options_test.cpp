#include "hub/control/link_options.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::string fault(std::string_view url, std::string_view name = "") {
  const Result<DialledLink> link = make_link(url, name);
  return link ? "" : link.error().sentence;
}

TEST(LinkOptions, ALinkIsNamedAfterItsUrlUnlessItHasAName) {
  EXPECT_EQ(make_link("tcp://lab:7450", "")->name, "tcp://lab:7450");
  EXPECT_EQ(make_link("tcp://lab:7450", "lab")->name, "lab");
  EXPECT_EQ(make_link("tcp://lab:7450", "lab")->address.url(), "tcp://lab:7450");
  EXPECT_EQ(make_link("unix:/run/hub", "")->address.path, "/run/hub");
  EXPECT_EQ(fault("tcp://h:1", std::string(255, 'n')), "");
}

TEST(LinkOptions, SaysWhatIsWrongWithAUrlOrAName) {
  EXPECT_THAT(fault("lab:7450"), HasSubstr("did you mean tcp://lab:7450?"));
  EXPECT_THAT(fault("tcp://lab"), HasSubstr("the port is missing"));
  EXPECT_THAT(fault(""), HasSubstr("cannot use the hub URL ''"));
  EXPECT_THAT(fault("tcp://a b:1"), AllOf(HasSubstr("'tcp://a b:1'"), HasSubstr("without spaces")));
  EXPECT_THAT(fault("unix:/a\nb"), HasSubstr("without spaces and control characters"));
  EXPECT_THAT(fault("unix:/\xff"), HasSubstr("cannot link to"));
  EXPECT_THAT(fault("unix:hub.sock"), HasSubstr("cannot link to 'unix:hub.sock': the path would"));
  EXPECT_THAT(fault("tcp://" + std::string(250, 'h') + ":1"), HasSubstr("at most 255 bytes"));
  EXPECT_THAT(fault("tcp://h:1", "a b"), HasSubstr("a link cannot have the name 'a b'"));
  EXPECT_THAT(fault("tcp://h:1", std::string(256, 'n')), HasSubstr("at most 255 bytes"));
}

TEST(LinkOptions, TellsThisMachineFromOthers) {
  for (const char* url : {"unix:/run/hub", "tcp://127.0.0.1:1", "tcp://127.9.9.9:1",
                          "tcp://[::1]:1", "tcp://localhost:1"})
    EXPECT_TRUE(is_local(make_link(url, "")->address)) << url;
  for (const char* url : {"tcp://10.0.0.1:1", "tcp://lab:1", "tcp://0.0.0.0:1", "tcp://[::]:1",
                          "tcp://127.evil.example:1", "tcp://localhost.example:1"})
    EXPECT_FALSE(is_local(make_link(url, "")->address)) << url;
}

}  // namespace
}  // namespace gimnet::hub
