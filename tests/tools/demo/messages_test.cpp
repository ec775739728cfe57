#include "tools/demo/messages.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "proto/bitestream/reader.hpp"
#include "proto/bitestream/writer.hpp"

namespace gimnet::demo {
namespace {

TEST(Messages, OdometryComesBack) {
  const Odometry sent{{7, 123}, {1.5, -2.5, 0.25}, {0.5, -0.25}, true, {3, 99}};
  const std::optional<Odometry> got = decode<Odometry>(encode(sent));
  ASSERT_TRUE(got);
  EXPECT_EQ(got->stamp.number, 7U);
  EXPECT_EQ(got->stamp.made_ns, 123);
  EXPECT_EQ(got->pose.y_m, -2.5);
  EXPECT_EQ(got->twist.angular_radps, -0.25);
  EXPECT_TRUE(got->bumped);
  EXPECT_EQ(got->answers.number, 3U);
  EXPECT_EQ(got->answers.made_ns, 99);
}

TEST(Messages, ScansComeBack) {
  Scan sent;
  sent.stamp = {1, 2};
  sent.first_bearing_rad = -1.5;
  sent.bearing_step_rad = 0.5;
  sent.range_max_m = 10.0;
  sent.ranges_m.assign(kScanBeamsMax, 2.5F);
  const std::optional<Scan> got = decode<Scan>(encode(sent));
  ASSERT_TRUE(got);
  EXPECT_EQ(got->ranges_m, sent.ranges_m);
  EXPECT_EQ(got->first_bearing_rad, -1.5);
  sent.ranges_m.push_back(1.0F);
  EXPECT_FALSE(decode<Scan>(encode(sent)));
}

TEST(Messages, InfoComesBackWithAndWithoutTexts) {
  RobotInfo sent;
  sent.stamp = {4, 5};
  sent.source = "a.log";
  sent.map = "#@#\n";
  sent.duration_s = 12.5;
  sent.ended = true;
  sent.scan_total = 77;
  const std::optional<RobotInfo> got = decode<RobotInfo>(encode(sent));
  ASSERT_TRUE(got);
  EXPECT_EQ(got->source, "a.log");
  EXPECT_EQ(got->note, "");
  EXPECT_EQ(got->map, "#@#\n");
  EXPECT_FALSE(got->is_log());
  EXPECT_EQ(got->duration_s, 12.5);
  EXPECT_TRUE(got->ended);
  EXPECT_EQ(got->scan_total, 77U);
}

TEST(Messages, CommandsComeBack) {
  const DriveCommand sent{{1, 2}, {0.5, 0.25}, 4.0, true, true};
  const std::optional<DriveCommand> got = decode<DriveCommand>(encode(sent));
  ASSERT_TRUE(got);
  EXPECT_EQ(got->twist.linear_mps, 0.5);
  EXPECT_EQ(got->speed, 4.0);
  EXPECT_TRUE(got->paused);
  EXPECT_TRUE(got->finish);
}

TEST(Messages, KeysAreTexts) {
  const Bytes bytes = encode(Odometry{});
  proto::bitestream::Reader reader(bytes);
  while (const auto value = reader.next()) EXPECT_TRUE(value->key().is_text());
  EXPECT_FALSE(reader.failed());
}

TEST(Messages, EveryCutIsRefusedOrEqual) {
  const Bytes whole = encode(DriveCommand{{1, 2}, {0.5, 0.25}, 4.0, true, true});
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_FALSE(decode<DriveCommand>(std::span(whole).first(size))) << size;
  }
}

TEST(Messages, NumbersThatAreNoneAreRefused) {
  Odometry odometry;
  odometry.pose.x_m = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(decode<Odometry>(encode(odometry)));
  odometry.pose.x_m = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(decode<Odometry>(encode(odometry)));
  odometry.pose.x_m = 1e10;
  EXPECT_FALSE(decode<Odometry>(encode(odometry)));
  Scan scan;
  scan.ranges_m = {1.0F, -1.0F};
  EXPECT_FALSE(decode<Scan>(encode(scan)));
  scan.ranges_m = {std::numeric_limits<float>::quiet_NaN()};
  EXPECT_FALSE(decode<Scan>(encode(scan)));
}

TEST(Messages, AWrongTypeIsRefused) {
  proto::bitestream::Writer writer;
  writer.put_text("n", "one");
  writer.put_time("t", 1);
  EXPECT_FALSE(decode<DriveCommand>(writer.bytes()));
}

}  // namespace
}  // namespace gimnet::demo
