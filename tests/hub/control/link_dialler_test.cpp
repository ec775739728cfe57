#include "hub/control/link_dialler.hpp"

#include <gtest/gtest.h>
#include <poll.h>

#include "net/address.hpp"

namespace gimnet::hub {
namespace {

DialledLink to_nobody() {
  DialledLink link;
  link.address = *net::parse_address("unix:/nowhere/at/all.sock");
  link.name = "nobody";
  return link;
}

/// Waits until the dialler says that an attempt ended.
std::vector<std::pair<LinkNumber, LinkDialler::Outcome>> wait(LinkDialler& dialler) {
  for (;;) {
    dialler.waker().prepare_to_sleep();
    auto ended = dialler.take_ended();
    if (!ended.empty()) return ended;
    pollfd ready{dialler.waker().descriptor(), POLLIN, 0};
    EXPECT_EQ(::poll(&ready, 1, 60'000), 1);
    dialler.waker().clear();
    dialler.waker().awake();
  }
}

TEST(LinkDialler, TellsWhyNobodyAnswers) {
  LinkDialler dialler;
  dialler.dial(LinkNumber{4}, to_nobody(), {}, {});
  auto ended = wait(dialler);
  ASSERT_EQ(ended.size(), 1u);
  EXPECT_EQ(ended[0].first, LinkNumber{4});
  ASSERT_FALSE(ended[0].second);
  EXPECT_NE(ended[0].second.error().sentence.find("/nowhere/at/all.sock"), std::string::npos);
}

TEST(LinkDialler, DialsNobodyPastAProxy) {
  LinkDialler dialler;
  DialledLink link = to_nobody();
  link.address = *net::parse_address("tcp://127.0.0.1:1");
  link.proxy = "proxy:3128";
  dialler.dial(LinkNumber{4}, link, {}, {});
  auto ended = wait(dialler);
  ASSERT_EQ(ended.size(), 1u);
  ASSERT_FALSE(ended[0].second);
  EXPECT_NE(ended[0].second.error().sentence.find("cannot use the proxy 'proxy:3128'"),
            std::string::npos);
  // Nobody listens at port 1, neither a proxy nor a hub.
  link.proxy = "http://127.0.0.1:1";
  dialler.dial(LinkNumber{5}, link, {}, {});
  ended = wait(dialler);
  ASSERT_EQ(ended.size(), 1u);
  ASSERT_FALSE(ended[0].second);
  EXPECT_TRUE(ended[0].second.error().sentence.starts_with("through the proxy http://127.0.0.1:1"))
      << ended[0].second.error().sentence;
}

TEST(LinkDialler, EndsWithAttemptsUnderWay) {
  LinkDialler dialler;
  for (std::uint32_t i = 1; i <= 10; ++i) dialler.dial(LinkNumber{i}, to_nobody(), {}, {});
}

}  // namespace
}  // namespace gimnet::hub
