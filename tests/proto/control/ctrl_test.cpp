#include "proto/control/ctrl.hpp"

#include <gtest/gtest.h>

#include <string>

#include "proto/control/names.hpp"
#include "proto/frame/frame_parser.hpp"
#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto::ctrl {
namespace {

using test::Bytes;
using test::load_vector;

Bytes payload_of(const std::string& vector) {
  const auto bytes = load_vector(vector);
  return test::to_bytes(parse_frame(bytes, Origin::hub)->payload);
}

template <class Message>
void expect_request(const std::string& vector, std::uint16_t request, const Message& message) {
  const auto payload = payload_of(vector);
  const auto decoded = decode<Message>(payload);
  ASSERT_TRUE(decoded) << decoded.error().sentence;
  EXPECT_EQ(*decoded, message) << vector;
  EXPECT_EQ(encode(message, request), payload) << vector;
}

template <class Answer>
void expect_answer(const std::string& vector, std::uint16_t request, const Answer& answer) {
  const auto payload = payload_of(vector);
  const auto decoded = decode_answer<Answer>(payload);
  ASSERT_TRUE(decoded) << decoded.error().sentence;
  EXPECT_EQ(*decoded, answer) << vector;
  EXPECT_EQ(encode_answer(answer, request), payload) << vector;
}

TEST(CtrlMessages, AreDecodedAndWrittenAsTheVectorsSay) {
  expect_request("ctrl/hub_info", 1, HubInfo{});
  expect_answer("ctrl/hub_info_answer", 1, HubInfoAnswer{HubId{7}, "lab", "0.1.0", 2, 60000, 3, 1});
  expect_request("ctrl/statistics", 2, Statistics{});
  expect_answer(
      "ctrl/statistics_answer", 2,
      StatisticsAnswer{{{0, {{"accepted", 10}, {"delivered", 9}}}, {1, {{"accepted", 0}}}}});
  expect_request("ctrl/connections", 3, Connections{NodeId{0x00700010}, 2});
  expect_answer("ctrl/connections_answer", 3,
                ConnectionsAnswer{{{NodeId{0x00700011},
                                    "robot",
                                    1,
                                    "tcp",
                                    "127.0.0.1:40000",
                                    true,
                                    {4096, 100, 1200, 10, 160, 3}}},
                                  false});
}

TEST(CtrlMessages, ThatChangeTheHubAreAsTheVectorsSay) {
  expect_request("ctrl/kick", 4, Kick{NodeId{0x00700012}, "it stands in the way"});
  expect_answer("ctrl/kick_answer", 4, KickAnswer{});
  expect_request("ctrl/reassign", 5, Reassign{NodeId{0x00700012}, NodeId{0x00700064}});
  expect_answer("ctrl/reassign_answer", 5, ReassignAnswer{});
  expect_request("ctrl/drain", 6, Drain{});
  expect_answer("ctrl/drain_answer", 6, DrainAnswer{});
  expect_request("ctrl/reload", 7, Reload{});
  expect_answer(
      "ctrl/reload_answer", 7,
      ReloadAnswer{{{"limits.nodes", "10", "20", false}, {"shards", "1", "2", true}}, false});
  expect_request("ctrl/log_level", 8, SetLogLevel{"debug"});
  expect_answer("ctrl/log_level_answer", 8, SetLogLevelAnswer{"info"});
}

TEST(CtrlMessages, AKickMayBeAnsweredWithARemark) {
  const KickAnswer answer{"it forgets that at a restart"};
  const Payload payload = encode_answer(answer, 3);
  const auto read = decode_answer<KickAnswer>(payload);
  ASSERT_TRUE(read);
  EXPECT_EQ(*read, answer);
}

TEST(CtrlMessages, EachRequestHasAName) {
  for (std::uint16_t operation = 1; operation < kRequestsEnd; ++operation)
    EXPECT_NE(operation_name(operation), nullptr);
  EXPECT_STREQ(operation_name(Kick::kOperation), "kick");
  for (const std::uint16_t none :
       {std::uint16_t{0}, std::uint16_t{kRequestsEnd}, KickAnswer::kOperation}) {
    EXPECT_EQ(operation_name(none), nullptr) << none;
  }
}

TEST(CtrlMessages, SkipCountersThatAreNotNumbers) {
  bitestream::Writer body;
  body.put_u16(1, 0);
  body.begin_nested(3);
  body.put_u16(1, 0);
  body.begin_nested(2);
  body.put_text("version", "9");
  body.put_u8("accepted", 1);
  body.put_u8(7, 1);
  body.end_nested();
  body.end_nested();
  const auto answer =
      decode_answer<StatisticsAnswer>(assemble_control({StatisticsAnswer::kOperation, 1}, body));
  ASSERT_TRUE(answer);
  EXPECT_EQ(*answer, (StatisticsAnswer{{{0, {{"accepted", 1}}}}}));
}

TEST(CtrlMessages, AConnectionMayComeWithoutCounts) {
  bitestream::Writer body;
  body.put_u16(1, 0);
  body.begin_nested(3);
  body.put_u32(1, 0x00700011);
  body.end_nested();
  const auto answer =
      decode_answer<ConnectionsAnswer>(assemble_control({ConnectionsAnswer::kOperation, 1}, body));
  ASSERT_TRUE(answer);
  ASSERT_EQ(answer->connections.size(), 1u);
  EXPECT_EQ(answer->connections[0].counts, ConnectionCounts{});
}

TEST(CtrlMessages, RecordsFitInTheBytesThatArePlannedForThem) {
  ConnectionRecord record;
  record.counts.missed = record.counts.queue_full = UINT64_MAX;
  record.name.assign(kNameBytesMax, 'n');
  record.transport.assign(kRemarkBytesMax, 't');
  record.peer.assign(kRemarkBytesMax, 'p');
  const ConnectionsAnswer one{{record}, false};
  EXPECT_EQ(*decode_answer<ConnectionsAnswer>(encode_answer(one, 1)), one);
  EXPECT_LE(encode_answer(one, 1).size() - encode_answer(ConnectionsAnswer{}, 1).size(),
            page_bytes_max(record));
}

}  // namespace
}  // namespace gimnet::proto::ctrl
