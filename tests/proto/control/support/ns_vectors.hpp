#pragma once

#include <gtest/gtest.h>

#include <string>

#include "proto/control/control_message.hpp"
#include "proto/frame/frame_parser.hpp"
#include "tests/vectors/vector_file.hpp"

// Control messages against the golden vectors.

namespace gimnet::test {

[[nodiscard]] inline Bytes payload_of(const std::string& vector) {
  const auto bytes = load_vector(vector);
  return to_bytes(proto::parse_frame(bytes, proto::Origin::hub)->payload);
}

/// A request or an event is read as, and written as, the vector.
template <class Message>
void expect_request(const std::string& vector, std::uint16_t request, const Message& message) {
  const auto payload = payload_of(vector);
  const auto decoded = proto::decode<Message>(payload);
  ASSERT_TRUE(decoded) << decoded.error().sentence;
  EXPECT_EQ(*decoded, message) << vector;
  EXPECT_EQ(proto::encode(message, request), payload) << vector;
}

template <class Answer>
void expect_answer(const std::string& vector, std::uint16_t request, const Answer& answer) {
  const auto payload = payload_of(vector);
  const auto decoded = proto::decode_answer<Answer>(payload);
  ASSERT_TRUE(decoded) << decoded.error().sentence;
  EXPECT_EQ(*decoded, answer) << vector;
  EXPECT_EQ(proto::encode_answer(answer, request), payload) << vector;
}

}  // namespace gimnet::test
