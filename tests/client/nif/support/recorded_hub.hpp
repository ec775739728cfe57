#pragma once

#include <gtest/gtest.h>
#include <sys/socket.h>

#include <cstdint>
#include <map>
#include <optional>
#include <semaphore>
#include <utility>
#include <vector>

#include "tests/client/nif/support/fake_hub.hpp"
#include "tests/client/nif/support/recording.hpp"

namespace gimnet::nif::test {

/// Says to one node what a hub said to it once, and expects of it what it said then.
class RecordedHub {
 public:
  RecordedHub(const std::vector<Connection>& connections, FakeHub& hub)
      : connections_(connections), hub_(hub) {}

  /// The node has its WELCOME: what the hub said later may follow.
  void let_go_on() { welcomed_.release(); }

  /// Until the node has closed the last of its connections.
  void play() {
    for (std::size_t i = 0; i < connections_.size(); ++i) {
      SCOPED_TRACE("the hub, connection " + std::to_string(i));
      play(connections_[i]);
      if (::testing::Test::HasFatalFailure()) return;
    }
  }

 private:
  void play(const Connection& steps) {
    FakeConnection connection = hub_.accept();
    hear_hello(connection, steps.front());
    connection.send(proto::kOpening);
    for (std::size_t i = 1; i < steps.size() && !::testing::Test::HasFatalFailure(); ++i) {
      const Step& step = steps[i];
      SCOPED_TRACE("step " + std::to_string(i));
      // The node has all that was said before the break: it reads to the end.
      if (step.is_break()) ::shutdown(connection.descriptor(), SHUT_WR);
      if (step.is_break() || step.is_of_the_library()) continue;
      if (step.from_hub) {
        say(connection, step);
        if (i == 1 && !is_goodbye(step)) {
          ASSERT_TRUE(welcomed_.try_acquire_for(kPatience));
        }
      } else if (!step.is(proto::Kind::link)) {
        hear(connection, step);
      }
    }
    static_cast<void>(connection.wait_closed());
  }
  /// Checks the HELLO: the node, and the name, the token and the counts with which it comes back.
  static void hear_hello(FakeConnection& connection, const Step& step) {
    const auto heard = connection.read_hello();
    ASSERT_TRUE(heard);
    const proto::Hello recorded = proto::decode<proto::Hello>(step.view().payload).value();
    EXPECT_EQ(heard->role, recorded.role);
    EXPECT_EQ(heard->name, recorded.name);
    EXPECT_EQ(heard->description, recorded.description);
    EXPECT_EQ(heard->token, recorded.token);
    if (recorded.resume_epoch == 0) return;
    EXPECT_EQ(heard->resume_epoch, recorded.resume_epoch);
    EXPECT_EQ(heard->resume_taken, recorded.resume_taken);
  }
  /// A break: the node closed, or said nothing.
  static Step next_of_the_program(FakeConnection& connection) {
    while (std::optional<Frame> frame = connection.next_message()) {
      Step heard{false, std::move(frame->bytes)};
      if (!heard.is_of_the_library()) return heard;
    }
    return {};
  }
  void say(FakeConnection& connection, const Step& step) {
    Bytes bytes = step.bytes;
    if (step.is_answer())
      store_le(bytes.data() + proto::kHeaderSize + 2, numbers_.at(step.control().header.request));
    connection.send(bytes);
  }
  /// The same frame, apart from what the library words: numbers and contents of requests, the parts
  /// of a message, and times.
  void hear(FakeConnection& connection, const Step& step) {
    std::optional<Bytes> whole;
    if (!step.is_request_kind()) {
      whole = parts_.add(step.view());
      if (!whole) return;
    }
    const Step heard = next_of_the_program(connection);
    ASSERT_FALSE(heard.is_break());
    EXPECT_EQ(heard.header().kind, step.header().kind);
    EXPECT_EQ(heard.header().dst, step.header().dst);
    EXPECT_EQ(heard.header().src, step.header().src);
    EXPECT_EQ(heard.header().lane, step.header().lane);
    EXPECT_EQ(heard.header().flags, step.header().flags & ~proto::kFlagFragment);
    if (step.is_request_kind()) {
      EXPECT_EQ(heard.operation(), step.operation());
      numbers_[step.control().header.request] = heard.control().header.request;
    } else {
      EXPECT_EQ(heard.view().key, step.view().key);
      EXPECT_EQ(gimnet::test::to_bytes(heard.view().payload), *whole);
      if ((step.header().flags & (proto::kFlagExt | proto::kFlagFragment)) == 0) {
        EXPECT_EQ(heard.bytes, step.bytes);
      }
    }
  }

  const std::vector<Connection>& connections_;
  FakeHub& hub_;
  std::counting_semaphore<> welcomed_{0};
  std::map<std::uint16_t, std::uint16_t> numbers_;  ///< of requests: as recorded, as heard
  Parts parts_;
};

}  // namespace gimnet::nif::test
