#include "hub/control/state/listing.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>

// Tests name the members that matter and leave the others at their defaults, on purpose.
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;

class ListingTest : public ::testing::Test {
 protected:
  Session& join(const std::string& name) {
    JoinRequest request;
    request.name = name;
    return *membership_.join(request, 0ms, effects_)->session;
  }
  GroupIndex advertise(const std::string& full_name) {
    return membership_.services().advertise(NodeIndex{1}, full_name, {}, 0ms, effects_)->group;
  }
  /// All pieces, each of bounded work, with what `between` does between them.
  template <class Between>
  std::vector<NodeIndex> all(const char* pattern, std::size_t most, std::size_t work,
                             Between between) {
    const auto parsed = proto::Pattern::parse(pattern);
    std::vector<NodeIndex> found;
    ListingRequest<NodeIndex> request{
        .pattern = *pattern == '\0' ? nullptr : &*parsed, .most = most, .work = work};
    for (int pieces = 0; pieces < 10'000; ++pieces) {
      const Listed<NodeIndex> listed = list_nodes(membership_, request);
      EXPECT_LE(listed.indices.size(), most);
      found.insert(found.end(), listed.indices.begin(), listed.indices.end());
      if (!listed.more) return found;
      EXPECT_GT(listed.next, request.after) << "every piece comes further";
      request.after = listed.next;
      between();
    }
    ADD_FAILURE() << "no end";
    return found;
  }
  std::vector<NodeIndex> all(const char* pattern, std::size_t most = 10, std::size_t work = 64) {
    return all(pattern, most, work, [] {});
  }

  Limits limits_;
  Membership membership_{Sessions::Options{HubId{7}, 1, Placement::spread}, limits_};
  Effects effects_;
};

TEST_F(ListingTest, FindsTheSameByNameAndById) {
  std::vector<NodeIndex> hall;
  for (int i = 0; i < 300; ++i) {
    hall.push_back(join("hall/robot-" + std::to_string(i)).index);
    join("yard/robot-" + std::to_string(i));
    join("");
  }
  EXPECT_EQ(all("hall/"
                "*",
                10, 1'000),
            hall)
      << "all that begin so are few enough to be looked at by name";
  EXPECT_EQ(all("hall/"
                "*",
                10, 64),
            hall)
      << "they are not";
  EXPECT_EQ(all("*/robot-7").size(), 2u);
  EXPECT_EQ(all("hall/robot-7", 10, 1'000).size(), 1u);
  EXPECT_EQ(all("hall/robot-7/"
                "*",
                10, 1'000)
                .size(),
            0u);
  EXPECT_EQ(all("**").size(), 600u);
  EXPECT_EQ(all("").size(), 900u) << "those without a name too";
  EXPECT_EQ(all("nobody/"
                "**")
                .size(),
            0u);
}

TEST_F(ListingTest, LooksAtNothingThatOnlyBeginsWithTheSameLetters) {
  const NodeIndex hall = join("hall-3").index;
  const NodeIndex robot = join("hall-3/robot").index;
  const NodeIndex arm = join("hall-3/robot/arm").index;
  for (int i = 0; i < 100; ++i) {
    // In the order of names, '-' and '.' stand before '/', digits and letters behind it.
    for (const char* between : {"-", ".", "", "x"})
      join("hall-3" + std::string{between} + std::to_string(i));
    join("hall-3-" + std::to_string(i) + "/robot");
  }
  const auto few = [this](const std::string& pattern, std::size_t work) {
    const auto parsed = proto::Pattern::parse(pattern);
    return list_few_nodes(membership_, {.pattern = &*parsed, .most = 10, .work = work});
  };
  const std::string in_hall = "hall-3/";
  ASSERT_TRUE(few(in_hall + "*", 3));
  EXPECT_EQ(few(in_hall + "*", 3)->indices, std::vector{robot}) << "a part is not no part";
  EXPECT_EQ(few(in_hall + "*", 3)->looked_at, 3u);
  EXPECT_FALSE(few(in_hall + "*", 2)) << "one more than may be looked at";
  EXPECT_EQ(few(in_hall + "**", 3)->indices, (std::vector{hall, robot, arm}));
  EXPECT_EQ(few(in_hall + "robot/" + "**", 2)->indices, (std::vector{robot, arm}));
  EXPECT_EQ(few(in_hall + "*/arm", 3)->indices, std::vector{arm});
  EXPECT_EQ(few("hall-3", 1)->indices, std::vector{hall});
  EXPECT_FALSE(few("hall-3", 0));
  EXPECT_TRUE(few("hall-4/" + std::string{"**"}, 0)->indices.empty());
  EXPECT_FALSE(few("*", 1'000)) << "any part, any name";
}

TEST_F(ListingTest, WhatChangesBetweenPiecesHidesAndRepeatsNothingElse) {
  std::set<NodeIndex> stay;
  std::vector<Session*> go;
  for (int i = 0; i < 200; ++i) {
    stay.insert(join("stay/" + std::to_string(i)).index);
    go.push_back(&join("go/" + std::to_string(i)));
  }
  int joined = 0;
  const auto found = all("**", 7, 64, [&] {
    if (!go.empty()) {
      membership_.connection_ended(*go.back(), {true, proto::GoodbyeCode::done, ""}, 0ms, effects_);
      go.pop_back();
    }
    join("late/" + std::to_string(joined++));
  });
  EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
  const std::set<NodeIndex> seen(found.begin(), found.end());
  EXPECT_EQ(seen.size(), found.size()) << "nobody twice";
  for (const NodeIndex index : stay) EXPECT_TRUE(seen.contains(index));
}

TEST_F(ListingTest, LeavesOutWhoIsAwayIfTold) {
  join("a");
  Session& away = join("b");
  membership_.connection_ended(away, {}, 0ms, effects_);
  EXPECT_EQ(
      list_nodes(membership_, {.connected_only = true, .most = 10, .work = 64}).indices.size(), 1u);
  EXPECT_EQ(
      list_nodes(membership_, {.connected_only = false, .most = 10, .work = 64}).indices.size(),
      2u);
  const auto pattern = proto::Pattern::parse("b");
  EXPECT_EQ(list_nodes(membership_,
                       {.pattern = &*pattern, .connected_only = true, .most = 10, .work = 64})
                .indices.size(),
            0u);
}

TEST_F(ListingTest, FindsServicesByTheirFullNames) {
  join("robot");
  const GroupIndex odom = advertise("robot/odom");
  const GroupIndex pose = advertise("robot/pose");
  ASSERT_TRUE(
      membership_.services().subscribe(NodeIndex{1}, "robot/nobody-offers-that", {}, effects_));
  const auto robot = proto::Pattern::parse("robot/*");
  const auto any = proto::Pattern::parse("**/pose");
  EXPECT_EQ(
      list_services(membership_.topics(), {.pattern = &*robot, .most = 10, .work = 64}).indices,
      (std::vector{odom, pose}));
  EXPECT_EQ(list_services(membership_.topics(), {.pattern = &*any, .most = 10, .work = 64}).indices,
            std::vector{pose});
  const Listed<GroupIndex> first = list_services(membership_.topics(), {.most = 1, .work = 64});
  EXPECT_EQ(first.indices, std::vector{odom});
  EXPECT_TRUE(first.more);
  EXPECT_EQ(
      list_services(membership_.topics(), {.after = first.next, .most = 1, .work = 64}).indices,
      std::vector{pose});
}

}  // namespace
}  // namespace gimnet::hub
