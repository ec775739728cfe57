#include "proto/frame/report.hpp"

#include <gtest/gtest.h>

#include <array>

#include "proto/frame/frame_parser.hpp"
#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto {
namespace {

using test::Bytes;
using test::load_vector;
using test::to_bytes;

Bytes report_payload() {
  const auto bytes = load_vector("frame/report");
  return to_bytes(parse_frame(bytes, Origin::hub)->payload);
}

TEST(Report, IsDecodedAndWrittenAsTheVectorSays) {
  const auto payload = report_payload();
  const auto report = decode_report(payload);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->reason, DropReason::queue_full);
  EXPECT_EQ(report->count, 3u);
  const auto reported = load_vector("frame/unicast");
  FrameHeader header = load_header(reported.data());
  header.flags = kFlagReport;
  EXPECT_EQ(report->header, header);
  EXPECT_EQ(to_bytes(report->following), to_bytes("hi"));
  std::array<std::byte, kReportSizeMax> memory{};
  memory.fill(std::byte{0xEE});
  const std::size_t size = encode_report(*report, memory);
  EXPECT_EQ(Bytes(memory.begin(), memory.begin() + static_cast<std::ptrdiff_t>(size)), payload);
}

TEST(Report, CarriesAtMost20BytesOfTheFrame) {
  const Bytes many(21, std::byte{1});
  Report report;
  report.following = many;
  std::array<std::byte, kReportSizeMax> memory{};
  EXPECT_EQ(encode_report(report, memory), kReportSizeMax);
  Bytes payload(memory.begin(), memory.end());
  payload.push_back(std::byte{2});
  EXPECT_EQ(decode_report(payload)->following.size(), kReportFollowingMax);
}

TEST(Report, RefusesAShortPayload) {
  auto payload = report_payload();
  payload.resize(kReportSizeMin);
  EXPECT_TRUE(decode_report(payload));
  payload.resize(kReportSizeMin - 1);
  EXPECT_FALSE(decode_report(payload));
}

TEST(Report, TakesAReasonOfALaterVersionForNone) {
  auto payload = report_payload();
  payload[0] = std::byte{kDropReasonCount};
  EXPECT_EQ(decode_report(payload)->reason, DropReason::none);
}

}  // namespace
}  // namespace gimnet::proto
