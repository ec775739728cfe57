#include <gtest/gtest.h>

#include <array>
#include <cstddef>

#include "tests/stress/support/api_caller.hpp"

// Calls that ask hubs, and those of administrators, which most nodes are denied. Nobody ends the
// hub.

namespace gimnet::stress {
namespace {

/// Reads the records of a list that was made.
template <class Record>
void read(gimi_list& list) {
  for (std::size_t i = 0; i < list.count; ++i) {
    Record record{};
    EXPECT_EQ(gimi_list_get(&list, i, &record, sizeof record), GIMI_OK);
  }
  gimi_list_release(&list);
  gimi_list_release(&list);
}

/// A node by chance: one that is there, or nobody.
gimi_peer peer(ApiCaller& c) {
  return c.one_in(8) ? static_cast<gimi_peer>(c.random()) : gimi_id(c.handle(Kind::node));
}

const char* pattern(ApiCaller& c) { return c.one_of({"", "**", "robot/*", "calc", "/", "*/a"}); }

void find(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  const char* const name = c.node_name();
  gimi_peer found = 0;
  c.timed(time, [&] { return gimi_find(node, name, time, &found); });
}

void name_of(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const gimi_peer whose = peer(c);
  const std::int32_t time = c.patience();
  std::array<char, GIMI_NAME_BYTES_MAX + 1> name{};
  c.timed(time, [&] { return gimi_name_of(node, whose, time, name.data(), name.size()); });
}

void nodes(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  const char* const wanted = pattern(c);
  gimi_list list{};
  c.timed(time, [&] { return gimi_nodes(node, wanted, time, &list); });
  read<gimi_node_record>(list);
}

void services(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  const char* const wanted = pattern(c);
  gimi_list list{};
  c.timed(time, [&] { return gimi_services(node, wanted, time, &list); });
  read<gimi_service_record>(list);
}

void watch(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  const char* const wanted = pattern(c);
  const auto subjects = static_cast<std::uint32_t>(c.below(5));
  gimi_handle made = 0;
  c.keep(c.timed(time, [&] { return gimi_watch(node, wanted, subjects, time, &made); }), made);
}

void watch_receive(ApiCaller& c) {
  const gimi_handle watched = c.handle(Kind::watch);
  const std::int32_t time = c.timeout();
  gimi_watch_event event{};
  c.timed(time, [&] { return gimi_watch_receive(watched, time, &event); });
  gimi_watch_event_release(&event);
  gimi_watch_event_release(&event);
}

template <gimi_hub_question kQuestion, class Record>
void hub(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  const std::uint32_t who = c.one_in(8) ? 77 : 0;
  gimi_list list{};
  c.timed(time, [&] { return gimi_hub(node, kQuestion, who, time, &list); });
  read<Record>(list);
}

void ping(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const gimi_peer to = peer(c);
  const std::int32_t time = c.timeout();
  const gimi_bytes echo = {"echo", 4};
  std::int64_t took = 0;
  c.timed(time, [&] { return gimi_ping(node, to, 0, &echo, time, &took); });
}

void trace(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const gimi_peer to = peer(c);
  const std::int32_t time = c.timeout();
  std::int64_t took = 0;
  gimi_list way{};
  c.timed(time, [&] { return gimi_trace(node, to, 0, time, &took, &way); });
  read<gimi_trace_hop_record>(way);
}

void kick(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const gimi_peer whom = peer(c);
  const std::int32_t time = c.patience();
  std::array<char, 64> remark{};
  c.timed(time,
          [&] { return gimi_kick(node, whom, "by chance", time, remark.data(), remark.size()); });
}

void reassign(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const gimi_peer whom = peer(c);
  const auto index = static_cast<gimi_peer>(1000 + c.below(1000));
  const gimi_peer to = c.one_in(2) ? peer(c) : (whom & ~0xFFFFFu) | index;
  const std::int32_t time = c.patience();
  c.timed(time, [&] { return gimi_reassign(node, {whom, to}, time); });
}

void reload_hub(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  gimi_list changes{};
  c.timed(time, [&] { return gimi_reload_hub(node, time, &changes); });
  read<gimi_hub_change_record>(changes);
}

void add_link(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  gimi_link_options link{};
  link.struct_size = sizeof link;
  link.url = "tcp://127.0.0.1:1";
  link.name = "nowhere";
  c.timed(time, [&] { return gimi_add_link(node, &link, time); });
}

void remove_link(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  c.timed(time, [&] { return gimi_remove_link(node, "nowhere", time); });
}

void set_link_cost(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  c.timed(time, [&] { return gimi_set_link_cost(node, "nowhere", 3, time); });
}

void set_log_level(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  const char* const level = c.one_of({"error", "off", "loud"});
  std::array<char, 16> before{};
  c.timed(time,
          [&] { return gimi_set_hub_log_level(node, level, time, before.data(), before.size()); });
}

}  // namespace

std::span<const ApiCall> hub_calls() {
  static constexpr std::array kCalls{
      ApiCall{"find", find},
      ApiCall{"name_of", name_of},
      ApiCall{"nodes", nodes},
      ApiCall{"services", services},
      ApiCall{"watch", watch},
      ApiCall{"watch_receive", watch_receive, 8},
      ApiCall{"hub", hub<GIMI_HUB, gimi_hub_record>, 1},
      ApiCall{"hub counters", hub<GIMI_HUB_COUNTERS, gimi_counter_record>, 1},
      ApiCall{"hub connections", hub<GIMI_HUB_CONNECTIONS, gimi_connection_record>, 1},
      ApiCall{"hub network", hub<GIMI_HUB_NETWORK, gimi_network_hub_record>, 1},
      ApiCall{"hub links", hub<GIMI_HUB_LINKS, gimi_link_record>, 1},
      ApiCall{"ping", ping},
      ApiCall{"trace", trace},
      ApiCall{"kick", kick, 2},
      ApiCall{"reassign", reassign, 2},
      ApiCall{"reload_hub", reload_hub, 1},
      ApiCall{"add_link", add_link, 1},
      ApiCall{"remove_link", remove_link, 1},
      ApiCall{"set_link_cost", set_link_cost, 1},
      ApiCall{"set_hub_log_level", set_log_level, 1},
  };
  return kCalls;
}

}  // namespace gimnet::stress
