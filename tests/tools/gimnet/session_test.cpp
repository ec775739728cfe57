#include "tools/gimnet/session.hpp"

#include <gtest/gtest.h>

#include <string>
#include <thread>

#include "tests/client/gimi/support/conversation.hpp"
#include "tests/client/gimi/support/made_message.hpp"

namespace gimnet::tool {
namespace {

class ConnectionWatchTest : public gimi::test::Conversation {
 protected:
  ConnectionWatchTest() : Conversation(true), watch_(*node_) {}

  void break_connection() {
    const std::uint32_t before = node_->state().reconnects;
    hub_.close();
    hub_ = fake_.admit(nif::test::make_welcome());
    while (node_->state().reconnects == before) std::this_thread::yield();
  }

  /// The words on standard error when a message comes that was received over that connection.
  std::string said_at_message_of(std::uint32_t connection) {
    const Message message = test::make_message("x", 1, {}, "", connection);
    testing::internal::CaptureStderr();
    watch_.take(message);
    return testing::internal::GetCapturedStderr();
  }

  ConnectionWatch watch_;
};

TEST_F(ConnectionWatchTest, AMessageOfANewerConnectionTellsTheBreak) {
  EXPECT_EQ(said_at_message_of(0), "");
  break_connection();
  const std::string said = said_at_message_of(1);
  EXPECT_NE(said.find("the connection broke"), std::string::npos) << said;
  EXPECT_NE(said.find("connected again"), std::string::npos) << said;
  EXPECT_EQ(said_at_message_of(1), "") << "once";
}

TEST_F(ConnectionWatchTest, DoesNotLookAtMessagesFromBeforeABreak) {
  break_connection();
  EXPECT_NE(said_at_message_of(1), "");
  // Had it looked, it would tell the next break.
  break_connection();
  EXPECT_EQ(said_at_message_of(0), "");
  EXPECT_EQ(said_at_message_of(1), "");
  EXPECT_NE(said_at_message_of(2), "");
}

}  // namespace
}  // namespace gimnet::tool
