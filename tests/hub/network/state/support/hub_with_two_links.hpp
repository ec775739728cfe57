#pragma once

#include <gtest/gtest.h>

#include <set>
#include <utility>
#include <vector>

#include "hub/network/state/network_state.hpp"
#include "tests/hub/network/state/support/hubs.hpp"

namespace gimnet::hub::test {

using std::chrono::seconds;

inline constexpr milliseconds kNow{1'000};
inline constexpr LinkNumber kFirst{1};
inline constexpr LinkNumber kSecond{2};

inline LinkFacts to(const HubIdentity& peer, std::uint16_t cost = 10) {
  return {peer, "url", true, cost};
}

inline proto::Payload bytes(
    const HubIdentity& hub, std::uint64_t sequence,
    const std::vector<std::pair<proto::HubKey, std::uint16_t>>& neighbours = {}) {
  return part(hub, sequence, neighbours)->bytes;
}

/// Everything that goes out: link and the hub of the record, "mark" as hub id 0.
inline std::multiset<std::pair<std::uint32_t, std::uint16_t>> sent(NetworkState& hub) {
  std::multiset<std::pair<std::uint32_t, std::uint16_t>> found;
  for (const Sending& each : hub.take_sendings()) {
    const PartRef record = read_part(*each.bytes);
    found.emplace(each.link.value(), record == nullptr ? 0 : record->said.hub.hub.value());
  }
  return found;
}
using Sent = std::multiset<std::pair<std::uint32_t, std::uint16_t>>;

/// Hub 5 with links to the hubs 2 and 3, which report it too.
class HubWithTwoLinks : public testing::Test {
 protected:
  HubWithTwoLinks() {
    hub_.begin_connection(kFirst, to(two_), kNow);
    hub_.begin_connection(kSecond, to(three_), kNow);
    hub_.take_record(kFirst, bytes(two_, 1, {{hub_key(5), 10}}), kNow);
    hub_.take_record(kSecond, bytes(three_, 1, {{hub_key(5), 10}}), kNow);
    hub_.take_mark(kFirst);
    hub_.take_mark(kSecond);
    hub_.advance(kNow);
    hub_.advance(kNow + seconds(5));
    (void)hub_.take_sendings();
  }

  /// A copy of this hub's state folder goes on behind it, and does so again when this hub goes on.
  void name_this_hub(const HubIdentity& as) {
    for (const std::uint64_t sequence : {90u, 92u}) {
      auto copy = said(as, sequence);
      copy.behind = proto::HubInstance{55};
      (void)hub_.take_sendings();
      hub_.take_record(kFirst, make_part(copy)->bytes, later_);
      if (sequence == 92) break;
      EXPECT_EQ(hub_.verdict(), Verdict::stay);
      hub_.advance(later_);
      later_ += seconds(2);
    }
  }

  const HubIdentity two_ = identity(2, 22);
  const HubIdentity three_ = identity(3, 33);
  NetworkState hub_{identity(5, 55), {"lab", "1.0"}};
  milliseconds later_ = kNow + seconds(10);
};

}  // namespace gimnet::hub::test
