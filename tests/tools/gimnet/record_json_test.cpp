#include "tools/gimnet/record_json.hpp"

#include <gtest/gtest.h>

namespace gimnet::tool {
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
  write(placed, service, "127.0.0.1:4000");
  EXPECT_TRUE(placed.str().ends_with(R"("hub":"lab","place":"127.0.0.1:4000"})")) << placed.str();
}

}  // namespace
}  // namespace gimnet::tool
