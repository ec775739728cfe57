#include "proto/control/control_message.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "proto/control/ns.hpp"
#include "proto/frame/frame_parser.hpp"
#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto {
namespace {

using test::Bytes;
using test::load_vector;

Bytes payload_of(const std::string& vector) {
  const auto bytes = load_vector(vector);
  return test::to_bytes(parse_frame(bytes, Origin::hub)->payload);
}

TEST(ControlMessage, BeginsWithOperationAndRequestNumber) {
  const auto payload = payload_of("ns/resolve_answer");
  const auto view = split_control(payload);
  ASSERT_TRUE(view);
  EXPECT_EQ(view->header, (ControlHeader{0x8003, 1}));
  EXPECT_TRUE(view->header.is_answer());
  EXPECT_EQ(view->body.size(), payload.size() - kControlHeaderSize);
  EXPECT_FALSE(split_control(std::span(payload).first(kControlHeaderSize - 1)));
}

TEST(ControlMessage, RefusalIsAnAnswerWithASentence) {
  const ControlHeader request{static_cast<std::uint16_t>(ns::NsOperation::resolve), 1};
  const Refusal refusal{Status::not_found, "no node is named robot/base"};
  EXPECT_EQ(encode_refusal(request, refusal), payload_of("ns/refusal"));
  const auto answer = decode_answer<ns::ResolveAnswer>(payload_of("ns/refusal"));
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().status, Status::not_found);
  EXPECT_EQ(answer.error().sentence, refusal.sentence);
}

TEST(ControlMessage, RefusalSurvivesAnySentence) {
  const Refusal refusal{Status::denied, std::string(2000, '\xFF')};
  const auto answer = decode_answer<ns::ResolveAnswer>(encode_refusal({3, 1}, refusal));
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().sentence, std::string(kSentenceBytesMax, '?'));
}

TEST(ControlMessage, AnswerWithoutStatusIsBad) {
  const auto answer = decode_answer<ns::ResolveAnswer>(test::from_hex("03 80 01 00"));
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().status, Status::bad_request);
}

TEST(ControlMessage, TellsTheStatusOfAnAnswerWithoutReadingIt) {
  EXPECT_EQ(peek_status(payload_of("ns/resolve_answer")), Status::done);
  EXPECT_EQ(peek_status(encode_refusal({3, 1}, {Status::denied, "no"})), Status::denied);
  EXPECT_EQ(peek_status(test::from_hex("03 80 01 00")), Status::bad_request);
  EXPECT_EQ(peek_status(Bytes(3)), Status::bad_request);
}

TEST(ControlMessage, OfAnotherOperationIsRefused) {
  EXPECT_FALSE(decode<ns::Reverse>(payload_of("ns/resolve")));
  EXPECT_FALSE(decode_answer<ns::ReverseAnswer>(payload_of("ns/resolve_answer")));
  EXPECT_FALSE(decode<ns::Resolve>(Bytes(3)));
}

TEST(ControlMessage, SkipsUnknownKeys) {
  bitestream::Writer body;
  body.put_u8("new", 1);
  body.put_text(3, "robot/base");
  body.put_u8(30, 1);
  body.put_u8(1000, 1);
  const auto payload = assemble_control({3, 1}, body);
  const auto resolve = decode<ns::Resolve>(payload);
  ASSERT_TRUE(resolve);
  EXPECT_EQ(resolve->name, "robot/base");
}

TEST(StatusNames, AreThoseOfTheDocument) {
  EXPECT_STREQ(status_name(Status::done), "done");
  EXPECT_STREQ(status_name(Status::limit), "limit");
  EXPECT_STREQ(status_name(Status::rate), "rate");
  EXPECT_STREQ(status_name(static_cast<Status>(kStatusCount)), "unknown");
}

}  // namespace
}  // namespace gimnet::proto
