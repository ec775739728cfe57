#include "hub/control/port_owner.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "hub/control/listener.hpp"

namespace gimnet::hub {
namespace {

TEST(PortOwner, NamesTheProcessThatListens) {
  const auto listener = Listener::open(*parse_listen_url("tcp://127.0.0.1:0"));
  ASSERT_TRUE(listener);
  EXPECT_EQ(port_owner((*listener)->url().port), process_text(::getpid()));
}

TEST(PortOwner, IsSilentAboutAPortThatNobodyListensOn) {
  auto listener = Listener::open(*parse_listen_url("tcp://127.0.0.1:0"));
  ASSERT_TRUE(listener);
  const std::uint16_t port = (*listener)->url().port;
  *listener = nullptr;
  EXPECT_EQ(port_owner(port), "");
}

TEST(ProcessText, GivesNameAndNumber) {
  EXPECT_THAT(process_text(::getpid()),
              ::testing::EndsWith(" (process " + std::to_string(::getpid()) + ")"));
  EXPECT_EQ(process_text(0), "process 0");
}

}  // namespace
}  // namespace gimnet::hub
