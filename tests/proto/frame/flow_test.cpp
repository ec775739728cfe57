#include "proto/frame/flow.hpp"

#include <gtest/gtest.h>

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "proto/frame/frame_parser.hpp"
#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto::flow {
namespace {

using test::Bytes;
using test::load_vector;

constexpr NodeId kNode{0x00700011};
constexpr std::int64_t kNewYear = 1767225600000000000;

const std::vector<std::pair<std::string, Message>>& examples() {
  static const std::vector<std::pair<std::string, Message>> kExamples = {
      {"flow/ping", Ping{3, kNewYear}},
      {"flow/pong", Pong{3, kNewYear, kNewYear + 40'000}},
      {"flow/credit", Credit{GroupId{0x00700005}, 40, 2}},
      {"flow/pause", Pause{{Kind::unicast, Lane::bulk, 0x00700012}}},
      {"flow/resume", Resume{{Kind::unicast, Lane::bulk, 0x00700012}}},
      {"flow/confirm", Confirm{1000}},
      {"flow/skip", Skip{DropReason::queue_full, 12}},
      {"flow/skip_unknown", Skip{DropReason::none, kSkipUnknown}},
      {"flow/dropped", Dropped{DropReason::queue_full, NodeId{0x00700012}, 12}},
      {"flow/missed", Missed{GroupId{0x00700005}, 12}},
  };
  return kExamples;
}

Bytes payload_of(const std::string& vector) {
  const auto bytes = load_vector(vector);
  return test::to_bytes(parse_frame(bytes, Origin::node)->payload);
}

TEST(Flow, HasAnExampleForEveryVector) {
  EXPECT_EQ(test::vectors_in("flow").size(), examples().size());
}

TEST(Flow, IsDecodedAndWrittenAsTheVectorsSay) {
  for (const auto& [name, message] : examples()) {
    EXPECT_EQ(decode(payload_of(name)), message) << name;
    std::array<std::byte, kFrameSizeMax> frame{};
    frame.fill(std::byte{0xEE});
    const std::size_t size = encode_frame(message, kNode, frame);
    EXPECT_EQ(Bytes(frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(size)),
              load_vector(name))
        << name;
  }
}

TEST(Flow, SkipsWhatALongerPayloadHas) {
  for (const auto& [name, message] : examples()) {
    auto payload = payload_of(name);
    payload.resize(payload.size() + 9, std::byte{0xEE});
    EXPECT_EQ(decode(payload), message) << name;
  }
}

TEST(Flow, RefusesAShorterPayload) {
  for (const auto& [name, message] : examples()) {
    auto payload = payload_of(name);
    while (!payload.empty()) {
      payload.pop_back();
      EXPECT_EQ(decode(payload), std::nullopt) << name << " of " << payload.size();
    }
  }
}

TEST(Flow, RefusesUnknownOperations) {
  Bytes payload(kSizeMax);
  for (const int operation : {0, 10, 255}) {
    payload[0] = static_cast<std::byte>(operation);
    EXPECT_EQ(decode(payload), std::nullopt) << operation;
  }
}

TEST(Flow, RefusesALaneThatThereIsNot) {
  auto payload = payload_of("flow/pause");
  payload[2] = std::byte{3};
  EXPECT_TRUE(decode(payload));
  payload[2] = std::byte{4};
  EXPECT_FALSE(decode(payload));
}

TEST(Flow, TakesAReasonOfALaterVersionForNone) {
  auto payload = payload_of("flow/skip");
  payload[1] = std::byte{20};
  EXPECT_EQ(decode(payload), Message(Skip{DropReason::wrong_source, 12}));
  payload[1] = std::byte{kDropReasonCount};
  EXPECT_EQ(decode(payload), Message(Skip{DropReason::none, 12}));
}

}  // namespace
}  // namespace gimnet::proto::flow
