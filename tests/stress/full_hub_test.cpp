#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "proto/control/ns.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/size.hpp"

// Many short connections with names at a hub that has few places: provable is that each gets one,
// and that those with a service keep theirs, connected or away.

namespace gimnet::stress {
namespace {

constexpr std::size_t kPlaces = 1'000;
/// As many strangers at a time as a hub hears of at once.
constexpr std::size_t kAtOnce = 200;

RawNode provider(const HubProcess& hub, const std::string& name) {
  JoinOptions options;
  options.hello.name = name;
  RawNode node(hub.unix_url(), options);
  proto::ns::Advertise service;
  service.service = "map";
  static_cast<void>(node.ask<proto::ns::AdvertiseAnswer>(proto::Kind::ns, service));
  return node;
}

/// Each joins with a name of its own and goes without a word.
void come_and_go(const HubProcess& hub, std::size_t first, std::size_t end) {
  const Deadline deadline;
  std::vector<RawNode> nodes(end - first);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    JoinOptions options;
    options.hello.name = "stranger/" + std::to_string(first + i);
    nodes[i].begin_join(hub.unix_url(), options);
  }
  for (RawNode& node : nodes) {
    while (!node.finish_join()) {
      deadline.check("WELCOME");
      wait_readable({node.descriptor()}, 100);
    }
  }
}

TEST(FullHub, ShortConnectionsTakeNoPlaceOfThoseWithAService) {
  const std::size_t strangers = is_full_size() ? 100'000 : 5'000;
  const HubProcess hub({"--shards", "2", "--limit", "nodes=" + std::to_string(kPlaces), "--limit",
                        "grace_ms=600000", "--limit", "silent_ms=600000"});
  RawNode present = provider(hub, "present");
  RawNode absent = provider(hub, "absent");
  const proto::Welcome session = absent.welcome();
  absent.close();
  for (std::size_t first = 0; first < strangers; first += kAtOnce)
    come_and_go(hub, first, std::min(strangers, first + kAtOnce));
  JoinOptions back;
  back.hello.name = "absent";
  back.hello.token = session.token;
  const RawNode returned(hub.unix_url(), back);
  EXPECT_EQ(returned.id(), session.node);
  const auto answer =
      present.ask<proto::ns::SubscribeAnswer>(proto::Kind::ns, proto::ns::Subscribe{"absent/map"});
  EXPECT_NE(answer.group, GroupId{}) << "its service was there all the time";
}

}  // namespace
}  // namespace gimnet::stress
