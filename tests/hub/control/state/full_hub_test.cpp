#include <gtest/gtest.h>

#include "hub/control/state/membership.hpp"

// A hub that has more nodes than it may: the limit was lowered while it runs.

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
    wanted.may_administer = true;
    const auto joined = membership_.join(wanted, now, effects_);
    return joined ? joined->session : nullptr;
  }
  GoodbyeCode refused(const std::string& name, std::chrono::milliseconds now) {
    const auto joined = membership_.join(request(name), now, effects_);
    return joined ? GoodbyeCode::done : joined.error().code;
  }
  void lose(Session& session, std::chrono::milliseconds now) {
    membership_.connection_ended(session, {false, GoodbyeCode::done, ""}, now, effects_);
  }

  Limits limits_;
  Membership membership_{Sessions::Options{HubId{7}, 2, Placement::spread}, limits_};
  Effects effects_;

 private:
  static JoinRequest request(const std::string& name) {
    JoinRequest result;
    result.name = name;
    result.origin = Origin{"tcp", "127.0.0.1:1"};
    result.identity = "open";
    return result;
  }
};

TEST_F(FullHub, NobodyMakesWayForOneWhoIsRefused) {
  join("a");
  join("b");
  Session* away = join("c");
  Session* nameless = join("");
  lose(*away, 1s);
  lose(*nameless, 1s);
  const std::uint32_t index = nameless->index;
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
  Session* nameless = join("");
  lose(*away, 1s);
  lose(*nameless, 1s);
  const std::uint32_t index = nameless->index;
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

TEST_F(FullHub, AnAdministratorTakesThePlaceOfANamelessOneThatIsAwayFirst) {
  limits_.administrators = 1;
  for (const char* name : {"a", "b", "c"}) join(name);
  Session* nameless = join("");
  lose(*nameless, 1s);
  EXPECT_NE(join_as_administrator(2s), nullptr);
  EXPECT_EQ(membership_.sessions().all().size(), 4u);
}

}  // namespace
}  // namespace gimnet::hub
