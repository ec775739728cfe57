#include "base/ids.hpp"

#include <gtest/gtest.h>

namespace gimnet {
namespace {

TEST(IdText, PrintsHubAndIndex) {
  EXPECT_EQ(to_string(make_id<NodeId>(HubId{7}, 17)), "7.17");
  EXPECT_EQ(to_string(make_id<GroupId>(HubId{7}, 17)), "7#17");
}

TEST(IdText, ReadsWhatItPrints) {
  for (const auto id : {NodeId{0}, make_id<NodeId>(HubId{7}, 17), NodeId{0xFFFFFFFF}}) {
    EXPECT_EQ(parse_node_id(to_string(id)), id);
  }
}

TEST(IdText, RefusesEverythingElse) {
  for (const char* text : {"", ".", "7", "7.", ".17", "7#17", "7.17 ", " 7.17", "7.-1", "+7.1",
                           "7.17.1", "4096.1", "7.1048576", "7.99999999999999999999", "robot"}) {
    EXPECT_EQ(parse_node_id(text), std::nullopt) << text;
  }
}

}  // namespace
}  // namespace gimnet
