#include "client/nif/connection_state.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>

#include "tests/client/nif/support/own_clock.hpp"

namespace gimnet::nif::test {
namespace {

using testing::HasSubstr;

TEST(ConnectionState, IsAwayUntilAConnectionStandsAndAfterItBroke) {
  ConnectionState state;
  EXPECT_TRUE(state.away());
  state.connect();
  EXPECT_TRUE(state.connected());
  state.lose();
  EXPECT_TRUE(state.away());
  state.connect();
  EXPECT_TRUE(state.connected());
}

TEST(ConnectionState, SaysForHowLongTheHubHasBeenAway) {
  std::int64_t now_ns = 5'000'000'000;
  const OwnClock clock([&] { return now_ns; });
  ConnectionState state;
  now_ns += 1'500'000'000;
  EXPECT_EQ(state.not_connected(), NIF_NOT_CONNECTED);
  EXPECT_THAT(error_text(), HasSubstr("away for 1.5 s"));
  EXPECT_EQ(state.no_turn(), NIF_TIMEOUT);
  EXPECT_THAT(error_text(), HasSubstr("away for 1.5 s"));
  state.connect();
  EXPECT_EQ(state.no_turn(), NIF_TIMEOUT);
  EXPECT_THAT(error_text(), HasSubstr("no room"));
  now_ns += 1'000'000'000;
  state.lose();
  now_ns += 200'000'000;
  state.lose();
  EXPECT_EQ(state.not_connected(), NIF_NOT_CONNECTED);
  EXPECT_THAT(error_text(), HasSubstr("away for 0.2 s")) << "since the break";
}

TEST(ConnectionState, EndsForGoodWithItsFirstFailureUntilTheHandleIsClosed) {
  ConnectionState state;
  state.end({NIF_REFUSED, "the hub refused the node"});
  EXPECT_TRUE(state.ended());
  state.end({NIF_PROTOCOL, "later"});
  EXPECT_EQ(state.not_connected(), NIF_REFUSED);
  EXPECT_STREQ(error_text(), "the hub refused the node");
  state.connect();
  state.lose();
  EXPECT_TRUE(state.ended());
  state.end({NIF_CLOSED, "the handle was closed"});
  EXPECT_EQ(state.not_connected(), NIF_CLOSED);
}

}  // namespace
}  // namespace gimnet::nif::test
