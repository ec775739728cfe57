#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "client/nif/error.hpp"
#include "tests/client/nif/support/frames.hpp"
#include "tests/client/nif/support/line.hpp"

namespace gimnet::nif::test {
namespace {

/// A message that stays in the queue.
nif_status hold(Line& line, const char* payload, unsigned flags = 0, std::int32_t timeout_ms = 0) {
  nif_outgoing message = NIF_OUTGOING_INIT;
  message.to = kPeerId;
  message.flags = static_cast<std::uint8_t>(NIF_FLAG_MORE | flags);
  return line.send(message, payload, timeout_ms);
}

TEST(OutboundConnection, WithoutResumeWhatWaitsAtABreakIsLostAndDrainTellsOnce) {
  Line line;
  EXPECT_EQ(hold(line, "lost"), NIF_OK);
  line.outbound.detach(true);
  EXPECT_EQ(line.outbound.drain(0), NIF_NOT_CONNECTED);
  line.attach(Line::session_of(false));
  EXPECT_EQ(line.outbound.drain(0), NIF_NOT_CONNECTED);
  EXPECT_EQ(line.outbound.drain(0), NIF_OK);
  EXPECT_TRUE(line.read().empty());
}

TEST(OutboundConnection, WithResumeItGoesToTheNextConnection) {
  Line line(Line::session_of(true));
  EXPECT_EQ(hold(line, "kept"), NIF_OK);
  line.outbound.detach(true);
  line.attach(Line::session_of(true));
  EXPECT_EQ(line.outbound.flush(), NIF_OK);
  EXPECT_TRUE(line.read().empty()) << "nobody knows yet where the services are";
  EXPECT_EQ(line.outbound.readdress({}), 0u);
  line.outbound.end_declaring();
  EXPECT_EQ(payloads(line.read()), std::vector<std::string>{"kept"});
}

TEST(OutboundConnection, WhileItIsAwayCallsThatFailSayForHowLong) {
  Line line(Line::session_of(true));
  line.outbound.detach(true);
  EXPECT_EQ(hold(line, "in time"), NIF_TIMEOUT);
  EXPECT_THAT(error_text(), testing::StartsWith("the hub has been away for 0."));
  EXPECT_EQ(hold(line, "at once", NIF_FLAG_NOT_WHILE_AWAY, NIF_FOREVER), NIF_NOT_CONNECTED);
  EXPECT_THAT(error_text(), testing::StartsWith("the hub has been away for 0."));
  EXPECT_EQ(line.outbound.flush(), NIF_NOT_CONNECTED);
  EXPECT_THAT(error_text(), testing::StartsWith("the hub has been away for 0."));
  line.attach(Line::session_of(true));
  EXPECT_EQ(hold(line, "back", NIF_FLAG_NOT_WHILE_AWAY), NIF_OK);
}

TEST(OutboundConnection, GoodbyeIsTheLastWord) {
  Line line;
  EXPECT_EQ(hold(line, "message"), NIF_OK);
  proto::FrameHeader header;
  header.kind = proto::Kind::link;
  const std::vector<std::byte> goodbye = frame_of(header, "goodbye");
  line.outbound.begin_leaving(5, goodbye);
  EXPECT_FALSE(line.outbound.write_last());
  const std::vector<std::string> said = payloads(line.read());
  ASSERT_EQ(said.size(), 3u) << "a CONFIRM before them";
  EXPECT_EQ(said[1], "message");
  EXPECT_EQ(said[2], "goodbye");
}

}  // namespace
}  // namespace gimnet::nif::test
