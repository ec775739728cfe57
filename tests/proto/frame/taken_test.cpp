#include "proto/frame/taken.hpp"

#include <gtest/gtest.h>

#include <array>

#include "proto/frame/frame_parser.hpp"
#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto {
namespace {

using test::Bytes;
using test::load_vector;

Bytes payload_of(const std::string& vector) {
  const auto bytes = load_vector(vector);
  return test::to_bytes(parse_frame(bytes, Origin::node)->payload);
}

TEST(Taken, IsDecodedAndWrittenAsTheVectorsSay) {
  const auto payload = payload_of("frame/taken");
  const auto taken = decode_taken(payload);
  EXPECT_EQ(taken, (Taken{9, 262144, 1310720}));
  EXPECT_FALSE(taken->refuses());
  EXPECT_TRUE(decode_taken(payload_of("frame/taken_refusal"))->refuses());
  std::array<std::byte, kTakenSize> memory{};
  encode_taken(*taken, memory);
  EXPECT_EQ(Bytes(memory.begin(), memory.end()), payload);
}

TEST(Taken, RefusesAShortPayload) {
  auto payload = payload_of("frame/taken");
  payload.push_back(std::byte{0});
  EXPECT_TRUE(decode_taken(payload));
  payload.resize(kTakenSize - 1);
  EXPECT_FALSE(decode_taken(payload));
}

}  // namespace
}  // namespace gimnet::proto
