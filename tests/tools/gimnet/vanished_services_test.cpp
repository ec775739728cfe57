#include "tools/gimnet/vanished_services.hpp"

#include <gtest/gtest.h>

namespace gimnet::tool {
namespace {

using Sentences = std::vector<std::string>;

constexpr std::int64_t kDue = VanishedServices::kLateNs;
const auto kSilent = [] { return true; };
const auto kHeard = [] { return false; };

Sentences said(const std::string& who, const std::string& them) {
  return {who + " came and went, and nothing came of " + them +
          ": what is published before this node has heard of a service and subscribed to it passes "
          "it by (`gimnet pub "
          "--wait 1` waits for that)"};
}

TEST(VanishedServices, AreToldWhenNothingCanComeAnyMore) {
  VanishedServices services;
  EXPECT_TRUE(services.empty());
  services.on_gone("r/s", kSilent, 100);
  EXPECT_FALSE(services.empty());
  EXPECT_EQ(services.news(100 + kDue - 1), Sentences{});
  EXPECT_EQ(services.news(100 + kDue), said("r/s", "it"));
  EXPECT_TRUE(services.empty());
  EXPECT_EQ(services.rest(), Sentences{}) << "once";
}

TEST(VanishedServices, AreNotToldOfWhomSomethingCame) {
  bool silent = true;
  VanishedServices services;
  services.on_gone("r/s", [&] { return silent; }, 0);
  services.on_gone("r/t", kHeard, 0);
  silent = false;  // its last message was behind the news that it is gone
  EXPECT_EQ(services.news(kDue), Sentences{});
  EXPECT_TRUE(services.empty());
}

TEST(VanishedServices, AreJudgedBeforeTheyAreBack) {
  bool silent = true;
  VanishedServices services;
  services.on_gone("r/s", [&] { return silent; }, 0);
  services.on_gone("r/t", kSilent, kDue);
  services.on_there("r/s");
  silent = false;  // what comes now is of its next time
  EXPECT_EQ(services.news(kDue), said("r/s", "it"));
}

TEST(VanishedServices, AreCounted) {
  VanishedServices services;
  services.on_gone("r/s", kSilent, 0);
  services.on_gone("r/t", kSilent, 0);
  EXPECT_EQ(services.rest(), said("r/s and 1 other", "them"));
  services.on_gone("r/t", kSilent, 0);
  services.on_gone("r/u", kSilent, 0);
  services.on_gone("r/v", kSilent, 0);
  EXPECT_EQ(services.rest(), said("r/t and 2 others", "them"));
}

TEST(VanishedServices, AreToldAtMostOnceASecond) {
  VanishedServices services;
  services.on_gone("r/s", kSilent, 0);
  EXPECT_EQ(services.news(kDue), said("r/s", "it"));
  services.on_gone("r/t", kSilent, 0);
  EXPECT_EQ(services.news(kDue + NewsPace::kPeriodNs - 1), Sentences{});
  EXPECT_EQ(services.news(kDue + NewsPace::kPeriodNs), said("r/t", "it"));
}

}  // namespace
}  // namespace gimnet::tool
