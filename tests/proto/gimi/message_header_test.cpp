#include "proto/gimi/message_header.hpp"

#include <gtest/gtest.h>

#include <array>
#include <string>

#include "proto/frame/frame_parser.hpp"
#include "proto/gimi/request.hpp"
#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto::gimi {
namespace {

using test::Bytes;
using test::load_vector;
using test::to_bytes;

constexpr std::int64_t kNewYear = 1767225600000000000;

Bytes payload_of(const std::string& vector) {
  const auto bytes = load_vector(vector);
  const auto frame = parse_frame(bytes, Origin::node);
  const auto key = StreamKey::of(*frame->key);
  EXPECT_TRUE(key == (StreamKey{3, 1}) || key.type == kRequestType) << vector;
  return to_bytes(frame->payload);
}

TEST(GimiMessage, HasATimeStamp) {
  const auto payload = payload_of("gimi/data");
  const auto message = parse_message(payload);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->header, (MessageHeader{1, MessageOperation::data,
                                            kFlagAckWanted | kFlagTimestamp, 8, 0x5eed0001}));
  EXPECT_EQ(message->timestamp_ns, kNewYear);
  EXPECT_EQ(to_bytes(message->data), to_bytes("hi"));
}

TEST(GimiMessage, HasAnExtensionToSkip) {
  const auto payload = payload_of("gimi/data_extension");
  const auto message = parse_message(payload);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->timestamp_ns, std::nullopt);
  EXPECT_EQ(message->extension.size(), 3u);
  EXPECT_EQ(to_bytes(message->data), to_bytes("hi"));
}

TEST(GimiMessage, PrefixIsWrittenAsTheVectorsSay) {
  for (const auto& name : test::vectors_in("gimi")) {
    if (name == "gimi/data_extension") continue;
    const auto payload = payload_of(name);
    const auto message = parse_message(payload);
    ASSERT_TRUE(message) << name;
    std::array<std::byte, kMessagePrefixMax> prefix{};
    const std::size_t size = write_message_prefix(message->header, message->timestamp_ns, prefix);
    Bytes written(prefix.begin(), prefix.begin() + static_cast<std::ptrdiff_t>(size));
    written.insert(written.end(), message->data.begin(), message->data.end());
    EXPECT_EQ(written, payload) << name;
  }
}

TEST(GimiMessage, TellsTheBytesOfTheApplication) {
  const auto data = payload_of("gimi/data_extension");
  EXPECT_EQ(application_bytes(true, data, 1'000), 1'000 - (data.size() - 2));
  EXPECT_EQ(application_bytes(false, data, 1'000), 1'000u);
  const auto request = payload_of("gimi/request");
  const auto body = decode_request(parse_message(request)->data);
  EXPECT_EQ(application_bytes(true, request, static_cast<std::uint32_t>(request.size())),
            body->data.size());
}

TEST(GimiMessage, RefusesWhatDoesNotFit) {
  auto payload = payload_of("gimi/data");
  EXPECT_FALSE(parse_message(std::span(payload).first(kMessageHeaderSize - 1)));
  EXPECT_FALSE(parse_message(std::span(payload).first(kMessagePrefixMax - 1)));
  EXPECT_TRUE(parse_message(std::span(payload).first(kMessagePrefixMax)));
  payload[10] = std::byte{7};
  EXPECT_FALSE(parse_message(payload)) << "a time stamp has 8 bytes";
  payload[9] = std::byte{0};
  EXPECT_TRUE(parse_message(payload));
  payload[8] = std::byte{7};
  EXPECT_FALSE(parse_message(payload)) << "operation 7";
}

TEST(GimiAck, IsDecodedAndWrittenAsTheVectorSays) {
  const auto payload = payload_of("gimi/ack");
  const auto message = parse_message(payload);
  EXPECT_EQ(message->header.sequence, 40u);
  EXPECT_EQ(decode_ack(message->data), (Ack{0b101, 0, 0}));
  std::array<std::byte, kAckSizeMax> memory{};
  ASSERT_EQ(encode_ack({0b101, 0, 0}, memory), kAckSize);
  EXPECT_EQ(Bytes(memory.begin(), memory.begin() + kAckSize), to_bytes(message->data));
  EXPECT_FALSE(decode_ack(message->data.first(kAckSize - 1)));
}

TEST(GimiAck, NamesTheGroupOfAService) {
  const auto payload = payload_of("gimi/ack_service");
  const auto message = parse_message(payload);
  const Ack ack{0, 0, (7u << 20) | 5};
  EXPECT_EQ(decode_ack(message->data), ack);
  std::array<std::byte, kAckSizeMax> memory{};
  ASSERT_EQ(encode_ack(ack, memory), kAckSizeMax);
  EXPECT_EQ(Bytes(memory.begin(), memory.end()), to_bytes(message->data));
  EXPECT_EQ(decode_ack(message->data.first(kAckSizeMax - 1))->group, 0u);
}

TEST(GimiPing, CarriesWhatIsToComeBack) {
  const auto ping = payload_of("gimi/ping");
  const auto pong = payload_of("gimi/pong");
  const auto data = parse_message(ping)->data;
  ASSERT_GT(data.size(), kPingTimeSize);
  EXPECT_EQ(load_le<std::int64_t>(data.data()), kNewYear);
  EXPECT_EQ(to_bytes(data.subspan(kPingTimeSize)), to_bytes("echo"));
  EXPECT_EQ(to_bytes(parse_message(pong)->data), to_bytes(data));
}

TEST(GimiError, HasAStatusAndASentence) {
  const auto payload = payload_of("gimi/error");
  const auto failure = decode_error(parse_message(payload)->data);
  ASSERT_TRUE(failure);
  EXPECT_EQ(failure->status, 6);
  EXPECT_EQ(failure->sentence, "too large");
  EXPECT_FALSE(decode_error(parse_message(payload)->data.first(1)));
  EXPECT_EQ(failure->group, 0u);
  EXPECT_EQ(encode_error(*failure), to_bytes(parse_message(payload)->data));
}

TEST(GimiError, NamesTheServiceOfAStreamThatLeadsToOne) {
  const auto payload = payload_of("gimi/error_service");
  const auto data = to_bytes(parse_message(payload)->data);
  const auto failure = decode_error(data);
  ASSERT_TRUE(failure);
  EXPECT_EQ(failure->status, 6);
  EXPECT_EQ(failure->group, (7u << 20) | 5);
  EXPECT_EQ(failure->sentence, "too large");
  EXPECT_EQ(encode_error(*failure), data);
  EXPECT_TRUE(decode_error(std::span(data).first(6)));
  EXPECT_FALSE(decode_error(std::span(data).first(5)));
}

}  // namespace
}  // namespace gimnet::proto::gimi
