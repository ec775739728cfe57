#include "tools/gimnet/json_writer.hpp"

#include <gtest/gtest.h>

namespace gimnet::tool {
namespace {

TEST(JsonWriter, NestsObjectsAndArrays) {
  JsonWriter json;
  json.begin_object()
      .member("a", 1)
      .key("b")
      .begin_array()
      .number(2)
      .text("x")
      .begin_object()
      .end_object();
  json.end_array().member("c", true).member("d", 0.5).end_object();
  EXPECT_EQ(json.str(), R"({"a":1,"b":[2,"x",{}],"c":true,"d":0.500})");
}

TEST(JsonWriter, EscapesText) {
  JsonWriter json;
  json.text("\"\\\n\t\x7f");
  EXPECT_EQ(json.str(), R"("\"\\\n\u0009\u007f")");
}

// As a reader sees them they are other text, or they steer its terminal.
TEST(JsonWriter, EscapesControlCharactersBeyondAscii) {
  JsonWriter json;
  json.text("\u0080\u009f\u00a0|\u2027\u2028\u202e\u202f|\u2065\u2066\u2069\u206a");
  EXPECT_EQ(json.str(),
            "\"\\u0080\\u009f\u00a0|\u2027\\u2028\\u202e\u202f|\u2065\\u2066\\u2069\u206a\"");
}

TEST(JsonWriter, KeepsUtf8AndReplacesWhatIsNone) {
  JsonWriter json;
  json.begin_array().text("ä€").text("a\xff").end_array();
  EXPECT_EQ(json.str(), "[\"ä€\",\"a\\ufffd\"]");
}

TEST(JsonWriter, WritesBytesAsTextOrAsHex) {
  const std::byte bytes[] = {std::byte{'h'}, std::byte{'i'}, std::byte{0xFF}};
  JsonWriter json;
  json.begin_object().bytes_member("a", std::span(bytes, 2)).bytes_member("b", bytes).end_object();
  EXPECT_EQ(json.str(), R"({"a":"hi","b_hex":"6869ff"})");
}

TEST(JsonWriter, HasNoNumberForInfinity) {
  JsonWriter json;
  json.number(1.0 / 0.0);
  EXPECT_EQ(json.str(), "null");
}

}  // namespace

namespace {

TEST(RecordJson, OfAService) {
  ServiceRecord service;
  service.name = "robot/odom";
  service.node = Peer{(7u << 20) | 17};
  service.key = {4, 2};
  service.delivery = Delivery::latest;
  service.group_id = 3;
  service.subscribers = 5;
  service.metadata = "pose";
  service.hub_name = "lab";
  JsonWriter json;
  write(json, service);
  EXPECT_EQ(
      json.str().find(
          R"({"name":"robot/odom","node":"7.17","type":4,"instance":2,"direction":"provides","delivery":"latest",)"),
      0u)
      << json.str();
  EXPECT_EQ(json.str().find("place"), std::string::npos) << "it is not known here";
  JsonWriter placed;
  write(placed, service, Provider{"127.0.0.1:4000", "away"});
  EXPECT_TRUE(
      placed.str().ends_with(R"("hub":"lab","missed":0,"place":"127.0.0.1:4000","state":"away"})"))
      << placed.str();
  service.missed = 12;
  service.missed_most = Peer{(7u << 20) | 18};
  JsonWriter slow;
  write(slow, service, Provider{"127.0.0.1:4000", "away"});
  EXPECT_NE(slow.str().find(R"("missed":12,"missed_most":"7.18",)"), std::string::npos);
  service.direction = Direction::accepts;
  EXPECT_STREQ(direction_of(service), "accepts");
  service.key.type = GIMI_REQUEST_TYPE;
  EXPECT_STREQ(direction_of(service), "answers");
}

}  // namespace

}  // namespace gimnet::tool
