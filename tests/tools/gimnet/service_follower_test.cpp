#include "tools/gimnet/service_follower.hpp"

#include <gtest/gtest.h>

namespace gimnet::tool {
namespace {

class MatchingServicesTest : public testing::Test {
 protected:
  std::optional<std::string> tell(Change change, const std::string& name = "",
                                  Direction direction = Direction::provides) {
    WatchEvent event;
    event.change = change;
    if (!name.empty()) {
      event.service.emplace();
      event.service->name = name;
      event.service->direction = direction;
    }
    return services_.take(event);
  }
  void snapshot(const std::vector<std::string>& names) {
    tell(Change::snapshot_begins);
    for (const std::string& name : names) tell(Change::present, name);
    tell(Change::snapshot_ends);
  }
  /// Subscribes to all that are wanted.
  std::vector<std::string> subscribe() {
    std::vector<std::string> names;
    while (const std::string* wanted = services_.wanted()) {
      names.push_back(*wanted);
      services_.settle(std::string(*wanted));
    }
    return names;
  }

  MatchingServices services_;
};

using Names = std::vector<std::string>;

TEST_F(MatchingServicesTest, WantsThoseOfTheSnapshotAndThoseThatCome) {
  EXPECT_FALSE(services_.complete());
  snapshot({"a/x", "b/x"});
  EXPECT_TRUE(services_.complete());
  tell(Change::advertised, "c/x");
  tell(Change::changed, "a/x");
  EXPECT_EQ(subscribe(), (Names{"a/x", "b/x", "c/x"}));
  EXPECT_EQ(subscribe(), Names{});
}

TEST_F(MatchingServicesTest, LeavesOutThoseThatAcceptData) {
  tell(Change::snapshot_begins);
  tell(Change::present, "a/in", Direction::accepts);
  tell(Change::snapshot_ends);
  tell(Change::advertised, "b/in", Direction::accepts);
  EXPECT_FALSE(services_.any());
  EXPECT_EQ(tell(Change::withdrawn, "b/in"), std::nullopt);
  EXPECT_EQ(subscribe(), Names{});
}

TEST_F(MatchingServicesTest, WhoCameWhileItWatchedIsLate) {
  snapshot({"a/x"});
  tell(Change::advertised, "b/x");
  subscribe();
  EXPECT_FALSE(services_.take_lateness("a/x"));
  EXPECT_TRUE(services_.take_lateness("b/x"));
  EXPECT_FALSE(services_.take_lateness("b/x")) << "once";
  EXPECT_FALSE(services_.take_lateness("c/x"));
  EXPECT_EQ(tell(Change::withdrawn, "a/x"), std::nullopt);
  EXPECT_EQ(tell(Change::withdrawn, "b/x"), "b/x");
  EXPECT_EQ(tell(Change::withdrawn, "b/x"), std::nullopt) << "is gone already";
}

TEST_F(MatchingServicesTest, WhoIsBackHasItsSubscription) {
  snapshot({});
  tell(Change::advertised, "a/x");
  EXPECT_TRUE(services_.any());
  EXPECT_EQ(tell(Change::withdrawn, "a/x"), "a/x");
  EXPECT_FALSE(services_.any());
  EXPECT_EQ(subscribe(), Names{"a/x"}) << "too late for this time, not for the next";
  tell(Change::advertised, "a/x");
  EXPECT_TRUE(services_.any());
  EXPECT_EQ(subscribe(), Names{});
  EXPECT_FALSE(services_.take_lateness("a/x"));
  EXPECT_EQ(tell(Change::withdrawn, "a/x"), std::nullopt);
}

TEST_F(MatchingServicesTest, WhoIsBackBeforeItHadOneIsLateAgain) {
  snapshot({});
  tell(Change::advertised, "a/x");
  tell(Change::withdrawn, "a/x");
  tell(Change::advertised, "a/x");
  EXPECT_EQ(services_.oldest_gone(), nullptr);
  EXPECT_EQ(subscribe(), Names{"a/x"}) << "once";
  EXPECT_TRUE(services_.take_lateness("a/x"));
}

TEST_F(MatchingServicesTest, ANewSnapshotTellsWhoIsThereNow) {
  snapshot({"a/x", "b/x"});
  subscribe();
  tell(Change::snapshot_begins);
  tell(Change::present, "b/x");
  tell(Change::advertised, "d/x");  // between its parts
  tell(Change::present, "c/x");
  tell(Change::snapshot_ends);
  EXPECT_EQ(subscribe(), (Names{"d/x", "c/x"}));
  ASSERT_NE(services_.oldest_gone(), nullptr);
  EXPECT_EQ(*services_.oldest_gone(), "a/x");
  EXPECT_TRUE(services_.take_lateness("c/x"));
  tell(Change::snapshot_begins);
  tell(Change::snapshot_ends);
  EXPECT_FALSE(services_.any());
}

TEST_F(MatchingServicesTest, RemembersSoManyThatAreGone) {
  snapshot({});
  for (std::size_t i = 0; i <= MatchingServices::kGoneMax; ++i) {
    EXPECT_FALSE(services_.remembers_too_many()) << i;
    const std::string name = "a/" + std::to_string(i);
    tell(Change::advertised, name);
    subscribe();
    tell(Change::withdrawn, name);
  }
  EXPECT_TRUE(services_.remembers_too_many());
  EXPECT_EQ(*services_.oldest_gone(), "a/0");
  services_.forget("a/0");
  EXPECT_FALSE(services_.remembers_too_many());
  EXPECT_EQ(*services_.oldest_gone(), "a/1");
  tell(Change::advertised, "a/0");
  EXPECT_EQ(subscribe(), Names{"a/0"}) << "is another one now";
  EXPECT_TRUE(services_.take_lateness("a/0"));
}

TEST_F(MatchingServicesTest, WhoIsForgottenIsNotWanted) {
  snapshot({"a/x", "b/x"});
  tell(Change::withdrawn, "a/x");
  services_.forget("a/x");
  EXPECT_EQ(subscribe(), Names{"b/x"});
}

}  // namespace

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
