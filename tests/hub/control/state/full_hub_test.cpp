#include <gtest/gtest.h>

#include "hub/control/state/membership.hpp"

// A hub that has as many nodes as it may, or more: the limit was lowered while it runs.

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using proto::GoodbyeCode;

class FullHub : public ::testing::Test {
 protected:
  FullHub() { limits_.nodes = 4; }

  Session* join(const std::string& name, std::chrono::milliseconds now = 0ms) {
    const auto joined = membership_.join(request(name), now, effects_);
    return joined ? joined->session : nullptr;
  }
  Session* join_as_administrator(std::chrono::milliseconds now = 1s) {
    JoinRequest wanted = request("");
    wanted.role = proto::Role::admin;
    wanted.rights.administer = true;
    const auto joined = membership_.join(wanted, now, effects_);
    return joined ? joined->session : nullptr;
  }
  GoodbyeCode refused(const std::string& name, std::chrono::milliseconds now,
                      const std::string& crowd = {}) {
    JoinRequest wanted = request(name);
    wanted.crowd = crowd;
    const auto joined = membership_.join(wanted, now, effects_);
    if (joined) return GoodbyeCode::done;
    sentence_ = joined.error().sentence;
    return joined.error().code;
  }
  void lose(Session& session, std::chrono::milliseconds now) {
    membership_.connection_ended(session, {false, GoodbyeCode::done, ""}, now, effects_);
  }

  Limits limits_;
  Membership membership_{Sessions::Options{HubId{7}, 2, Placement::spread}, limits_};
  Effects effects_;
  std::string sentence_;

  static JoinRequest request(const std::string& name) {
    JoinRequest result;
    result.name = name;
    result.origin = PeerAddress{"tcp", "127.0.0.1:1"};
    result.identity = Identity::open();
    return result;
  }
};

TEST_F(FullHub, NobodyMakesWayForOneWhoIsRefused) {
  join("a");
  join("b");
  Session* away = join("c");
  Session* idle = join("idle");
  lose(*away, 1s);
  lose(*idle, 1s);
  const NodeIndex index = idle->index;
  limits_.nodes = 2;
  effects_.clear();
  EXPECT_EQ(refused("c", 2s), GoodbyeCode::hub_full);
  EXPECT_EQ(refused("d", 2s), GoodbyeCode::hub_full);
  EXPECT_TRUE(effects_.empty());
  EXPECT_TRUE(membership_.directory().find("c"));
  EXPECT_NE(membership_.sessions().find(index), nullptr);
}

TEST_F(FullHub, AsManyMakeWayAsHaveTo) {
  join("a");
  join("b");
  Session* away = join("c");
  Session* idle = join("idle");
  lose(*away, 1s);
  lose(*idle, 1s);
  const NodeIndex index = idle->index;
  limits_.nodes = 3;
  EXPECT_EQ(refused("c", 2s), GoodbyeCode::done);
  EXPECT_EQ(membership_.sessions().find(index), nullptr);
  EXPECT_EQ(membership_.sessions().all().size(), 3u);
}

TEST_F(FullHub, AdministratorsHavePlacesBeyondTheLimit) {
  limits_.administrators = 2;
  for (const char* name : {"a", "b", "c", "d"}) join(name);
  EXPECT_EQ(refused("e", 0ms), GoodbyeCode::hub_full);
  EXPECT_NE(join_as_administrator(), nullptr);
  Session* second = join_as_administrator();
  ASSERT_NE(second, nullptr);
  EXPECT_EQ(join_as_administrator(), nullptr) << "one beyond";
  membership_.connection_ended(*second, {true, GoodbyeCode::done, ""}, 1s, effects_);
  EXPECT_NE(join_as_administrator(), nullptr);
  // Their places are no room for others.
  Session* node = membership_.sessions().find(*membership_.directory().find("a"));
  membership_.connection_ended(*node, {true, GoodbyeCode::done, ""}, 1s, effects_);
  EXPECT_EQ(refused("e", 1s), GoodbyeCode::hub_full);
}

TEST_F(FullHub, AnAdministratorTakesThePlaceOfOneThatIsAwayFirst) {
  limits_.administrators = 1;
  for (const char* name : {"a", "b", "c"}) join(name);
  Session* idle = join("idle");
  lose(*idle, 1s);
  EXPECT_NE(join_as_administrator(2s), nullptr);
  EXPECT_EQ(membership_.sessions().all().size(), 4u);
}

TEST_F(FullHub, OneThatMakesWayGoesOnceThoughItHoldsTheName) {
  join("a");
  Session* away = join("b");
  lose(*away, 1s);
  limits_.nodes = 1;
  effects_.clear();
  EXPECT_EQ(refused("b", 2s), GoodbyeCode::hub_full);
  EXPECT_TRUE(effects_.empty()) << "it holds the name, and nobody else is away";
  limits_.nodes = 2;
  EXPECT_EQ(refused("b", 2s), GoodbyeCode::done);
}

TEST_F(FullHub, OneCrowdHasHalfOfThePlaces) {
  EXPECT_EQ(refused("a", 0ms, "10.0.0.1"), GoodbyeCode::done);
  EXPECT_EQ(refused("b", 0ms, "10.0.0.1"), GoodbyeCode::done);
  EXPECT_EQ(refused("c", 0ms, "10.0.0.1"), GoodbyeCode::hub_full) << "one beyond";
  EXPECT_EQ(sentence_,
            "nodes of 10.0.0.1 have half of this hub's places (2 of 4), and no address or user may "
            "have more; end some of them, or start the hub with a larger --limit nodes");
  EXPECT_EQ(refused("c", 0ms, "uid 1000"), GoodbyeCode::done);
  EXPECT_EQ(refused("d", 0ms), GoodbyeCode::done) << "no crowd is not bounded";
  Session* a = membership_.sessions().find(*membership_.directory().find("a"));
  membership_.connection_ended(*a, {true, GoodbyeCode::done, ""}, 1s, effects_);
  EXPECT_EQ(refused("a", 1s, "10.0.0.1"), GoodbyeCode::done);
}

TEST_F(FullHub, OneThatIsAwayMakesWayForItsOwnName) {
  refused("a", 0ms, "10.0.0.1");
  refused("b", 0ms, "10.0.0.1");
  lose(*membership_.sessions().find(*membership_.directory().find("a")), 1s);
  EXPECT_EQ(refused("a", 2s, "10.0.0.1"), GoodbyeCode::done);
  EXPECT_TRUE(membership_.directory().find("b"));
}

TEST_F(FullHub, OneThatIsAwayLongestMakesWayInItsCrowd) {
  refused("elsewhere", 0ms, "10.0.0.2");
  lose(*membership_.sessions().find(*membership_.directory().find("elsewhere")), 0ms);
  refused("a", 0ms, "10.0.0.1");
  refused("b", 0ms, "10.0.0.1");
  lose(*membership_.sessions().find(*membership_.directory().find("b")), 1s);
  lose(*membership_.sessions().find(*membership_.directory().find("a")), 2s);
  EXPECT_EQ(refused("c", 3s, "10.0.0.1"), GoodbyeCode::done);
  EXPECT_FALSE(membership_.directory().find("b"));
  EXPECT_TRUE(membership_.directory().find("elsewhere")) << "of another crowd";
  EXPECT_EQ(refused("d", 3s, "10.0.0.1"), GoodbyeCode::done);
  EXPECT_FALSE(membership_.directory().find("a"));
  EXPECT_EQ(refused("e", 3s, "10.0.0.1"), GoodbyeCode::hub_full) << "nobody of it is away";
}

TEST_F(FullHub, ANodeThatComesBackFromElsewhereCountsThere) {
  refused("a", 0ms, "10.0.0.1");
  refused("b", 0ms, "10.0.0.1");
  Session& a = *membership_.sessions().find(*membership_.directory().find("a"));
  JoinRequest again = request("a");
  const std::vector<std::byte> token = membership_.sessions().token_of(a);
  again.token = token;
  again.crowd = "10.0.0.2";
  ASSERT_TRUE(membership_.join(again, 1s, effects_));
  EXPECT_EQ(refused("c", 1s, "10.0.0.1"), GoodbyeCode::done);
  EXPECT_EQ(refused("d", 1s, "10.0.0.1"), GoodbyeCode::hub_full);
}

TEST_F(FullHub, ACrowdHasOnePlaceAtLeast) {
  limits_.nodes = 1;
  EXPECT_EQ(refused("a", 0ms, "10.0.0.1"), GoodbyeCode::done);
}

}  // namespace
}  // namespace gimnet::hub
