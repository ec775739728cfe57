#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <variant>
#include <vector>

#include "hub/control/state/membership.hpp"

namespace gimnet::hub {

/// A hub of four places, and its nodes.
class MembershipTest : public ::testing::Test {
 protected:
  MembershipTest() { limits_.nodes = 4; }

  JoinRequest request(const std::string& name) {
    JoinRequest result;
    result.name = name;
    result.origin = PeerAddress{"tcp", "127.0.0.1:1"};
    result.identity = Identity::open();
    return result;
  }
  Session* join(const std::string& name, std::chrono::milliseconds now = {}) {
    const auto joined = membership_.join(request(name), now, effects_);
    return joined ? joined->session : nullptr;
  }
  std::vector<std::byte> token_of(const Session& session) {
    return membership_.sessions().token_of(session);
  }
  proto::GoodbyeCode refused(const JoinRequest& wanted, std::chrono::milliseconds now = {}) {
    const auto joined = membership_.join(wanted, now, effects_);
    return joined ? proto::GoodbyeCode::done : joined.error().code;
  }
  void lose(Session& session, std::chrono::milliseconds now) {
    membership_.connection_ended(session, {false, proto::GoodbyeCode::done, ""}, now, effects_);
  }
  template <class Kind>
  std::size_t count() const {
    return static_cast<std::size_t>(
        std::count_if(effects_.begin(), effects_.end(),
                      [](const Effect& effect) { return std::holds_alternative<Kind>(effect); }));
  }

  Limits limits_;
  Membership membership_{Sessions::Options{HubId{7}, 2, Placement::spread}, limits_};
  Effects effects_;
};

}  // namespace gimnet::hub
