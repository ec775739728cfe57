#include "proto/gimi/request.hpp"

#include <gtest/gtest.h>

namespace gimnet::proto::gimi {
namespace {

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

TEST(RequestError, OneThatIsTooShortIsNone) {
  const auto data = encode_request_error({RequestFault::busy, 0, ""});
  EXPECT_TRUE(decode_request_error(data));
  EXPECT_FALSE(decode_request_error(std::span(data).first(data.size() - 1)));
  EXPECT_FALSE(decode_request_error({}));
}

}  // namespace
}  // namespace gimnet::proto::gimi
