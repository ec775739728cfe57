#include "hub/limits.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "proto/control/control_message.hpp"

namespace gimnet::hub {
namespace {

using ::testing::HasSubstr;

std::string set(Limits& limits, std::string_view name, std::string_view value) {
  return set_limit(limits, *find_limit(name), value);
}

TEST(Limits, EveryFieldIsInTheTableOnce) {
  std::set<std::string_view> names;
  for (const LimitInfo& limit : limit_table())
    EXPECT_TRUE(names.insert(limit.name).second) << limit.name;
  EXPECT_EQ(names.size() * sizeof(std::uint64_t), sizeof(Limits));
}

TEST(Limits, DefaultsAreWithinTheirRanges) {
  const Limits defaults;
  for (const LimitInfo& limit : limit_table()) {
    EXPECT_GE(defaults.*limit.field, limit.least) << limit.name;
    EXPECT_LE(defaults.*limit.field, limit.most) << limit.name;
    EXPECT_FALSE(limit.reason.empty()) << limit.name;
    EXPECT_FALSE(limit.unit.empty()) << limit.name;
  }
}

TEST(Limits, EachTakesItsLeastAndMostAndNothingBeyond) {
  for (const LimitInfo& limit : limit_table()) {
    Limits limits;
    EXPECT_EQ(set_limit(limits, limit, std::to_string(limit.most)), "");
    EXPECT_EQ(limits.*limit.field, limit.most);
    EXPECT_EQ(set_limit(limits, limit, std::to_string(limit.least)), "");
    EXPECT_EQ(limits.*limit.field, limit.least);
    EXPECT_THAT(set_limit(limits, limit, std::to_string(limit.most + 1)), HasSubstr("must be"));
    if (limit.least > 0) {
      EXPECT_THAT(set_limit(limits, limit, std::to_string(limit.least - 1)), HasSubstr("must be"));
    }
    EXPECT_EQ(limits.*limit.field, limit.least);
  }
}

// docs/protocol.md, section 8: no WELCOME says less, so a node may always have so many unanswered.
TEST(Limits, RequestsAreNeverFewerThanEveryNodeMayAsk) {
  Limits limits;
  ASSERT_NE(find_limit("requests"), nullptr);
  EXPECT_EQ(find_limit("requests")->least, proto::kOpenRequestsMax);
  EXPECT_EQ(set(limits, "requests", "64"), "");
  EXPECT_THAT(set(limits, "requests", "63"), HasSubstr("64 to 65536"));
}

TEST(Limits, OneNodeRetainsHalfOfTheBudgetAtMost) {
  Limits limits;
  EXPECT_EQ(limits.retained_most(), 16ull << 20);
  EXPECT_EQ(set(limits, "retained_budget_bytes", "32M"), "");
  EXPECT_EQ(limits.retained_most(), 16ull << 20);
  EXPECT_EQ(set(limits, "retained_budget_bytes", "1001"), "");
  EXPECT_EQ(limits.retained_most(), 500u);
}

TEST(Limits, SuffixesArePowersOf1024) {
  Limits limits;
  EXPECT_EQ(set(limits, "resume_bytes", "64k"), "");
  EXPECT_EQ(limits.resume_bytes, 65'536u);
  EXPECT_EQ(set(limits, "budget_bytes", "1G"), "");
  EXPECT_EQ(limits.budget_bytes, 1ull << 30);
  EXPECT_EQ(set(limits, "lane2_bytes", "8M"), "");
  EXPECT_EQ(limits.lane2_bytes, 8ull << 20);
}

TEST(Limits, WhatIsNoNumberIsRefused) {
  Limits limits;
  for (const char* bad : {"", "abc", "-1", "1.5", "10T", "10kk", " 10", "99999999999999999999",
                          "18446744073709551615G"}) {
    EXPECT_NE(set(limits, "nodes", bad), "") << bad;
  }
  EXPECT_EQ(limits.nodes, Limits{}.nodes);
}

TEST(Limits, AnUnknownNameHasTheNearestOne) {
  EXPECT_EQ(find_limit("nods"), nullptr);
  EXPECT_EQ(nearest_limit("nods"), "; did you mean nodes?");
  EXPECT_EQ(nearest_limit("qqqqqqqq"), "");
}

}  // namespace
}  // namespace gimnet::hub
