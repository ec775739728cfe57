#include "proto/gimi/request.hpp"

#include <gtest/gtest.h>

#include <string>

#include "proto/frame/frame_parser.hpp"
#include "proto/gimi/message_header.hpp"
#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto::gimi {
namespace {

using test::to_bytes;

/// The data of the GIMI message in that vector.
test::Bytes data_of(const std::string& vector, std::uint8_t flags = 0) {
  const auto bytes = test::load_vector(vector);
  const auto message = parse_message(parse_frame(bytes, Origin::node)->payload);
  EXPECT_EQ(message->header.flags, flags) << vector;
  return to_bytes(message->data);
}

TEST(RequestError, IsReadAsItWasWritten) {
  const auto data = encode_request_error({RequestFault::failed, -7, "no numbers"});
  const auto error = decode_request_error(data);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->fault, RequestFault::failed);
  EXPECT_EQ(error->code, -7);
  EXPECT_EQ(error->sentence, "no numbers");
}

TEST(RequestError, IsAsTheDocumentShows) {
  const auto data = encode_request_error({RequestFault::busy, 2, "x"});
  const std::vector<std::byte> bytes{std::byte{0x01}, std::byte{0x01}, std::byte{2},  std::byte{0},
                                     std::byte{0},    std::byte{0},    std::byte{'x'}};
  EXPECT_EQ(data, bytes);
}

TEST(Request, HasTheTimeThatIsLeftBeforeItsData) {
  const auto data = data_of("gimi/request");
  const auto request = decode_request(data);
  ASSERT_TRUE(request);
  EXPECT_EQ(request->left_ms, 1500u);
  EXPECT_EQ(to_bytes(request->data), to_bytes("1 2"));
  const auto again = data_of("gimi/request_again", kFlagAgain | kFlagRepeat);
  EXPECT_EQ(decode_request(again)->left_ms, 1000u);
}

TEST(Request, OneThatIsTooShortIsNone) {
  const auto data = data_of("gimi/request");
  EXPECT_TRUE(decode_request(std::span(data).first(kRequestPrefix)));
  EXPECT_FALSE(decode_request(std::span(data).first(kRequestPrefix - 1)));
}

TEST(RequestError, IsAsTheVectorSays) {
  const auto data = data_of("gimi/error_request");
  const auto error = decode_request_error(data);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->fault, RequestFault::failed);
  EXPECT_EQ(error->code, -7);
  EXPECT_EQ(error->sentence, "no numbers");
  EXPECT_EQ(encode_request_error(*error), data);
}

TEST(RequestError, OneThatIsTooShortIsNone) {
  const auto data = encode_request_error({RequestFault::busy, 0, ""});
  EXPECT_TRUE(decode_request_error(data));
  EXPECT_FALSE(decode_request_error(std::span(data).first(data.size() - 1)));
  EXPECT_FALSE(decode_request_error({}));
}

}  // namespace
}  // namespace gimnet::proto::gimi
