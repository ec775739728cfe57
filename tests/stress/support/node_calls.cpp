#include <array>
#include <cstddef>
#include <string>

#include "tests/stress/support/api_caller.hpp"

// Calls of nodes, names, wait sets, and of what hubs tell.

namespace gimnet::stress {
namespace {

void join(ApiCaller& c) {
  const std::string hub = c.shared.hubs[c.below(c.shared.hubs.size())];
  gimi_node_options options{};
  options.struct_size = sizeof options;
  options.name = c.node_name();
  options.hub = hub.c_str();
  options.description = "whole_api_test";
  options.timeout_ms = 500;
  options.wait_for_hub = c.one_in(4) ? 1 : 0;
  options.no_reconnect = c.one_in(12) ? 1 : 0;
  options.resume = c.one_of<std::uint8_t>({0, 0, 0, 1, 1, 2, 2, 3});
  options.no_token_file = c.one_in(3) ? 0 : 1;
  options.shard_plus_one = c.one_of<std::uint8_t>({0, 0, 0, 1, 2, 200});
  options.administrator = c.one_in(8) ? 1 : 0;
  options.number_if_taken = c.one_in(4) ? 1 : 0;
  options.socket_receive_bytes = c.one_in(4) ? 4096 : 0;
  options.message_bytes_max = c.one_in(4) ? 4096 : 0;
  options.receive_bytes = c.one_in(4) ? 64 * 1024 : 0;
  options.queue_messages = c.one_of<std::size_t>({0, 0, 1, 3});
  gimi_handle node = 0;
  c.keep(c.timed(500, [&] { return gimi_join(&options, &node); }), node);
}

void leave(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  c.timed(0, [&] { return gimi_leave(node); });
}

void close(ApiCaller& c) {
  Kind kind = static_cast<Kind>(1 + c.below(kKinds));
  if (kind == Kind::node && !c.one_in(3)) kind = Kind::subscription;
  // Also one that others still find; so twice.
  c.close(c.one_in(3) ? c.handle(kind) : c.shared.handles.take(kind, c.random));
}

void id(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  c.number([&] { return gimi_id(node); });
}

void state(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  gimi_node_state state{};
  state.struct_size = sizeof state;
  c.timed(0, [&] { return gimi_state(node, &state); });
}

void lost(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  gimi_lost_counts counts{};
  counts.struct_size = sizeof counts;
  c.timed(0, [&] { return gimi_lost(node, &counts); });
}

void watch_connection(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  gimi_handle events = 0;
  c.keep(c.timed(0, [&] { return gimi_watch_connection(node, &events); }), events);
}

void connection_receive(ApiCaller& c) {
  const gimi_handle events = c.handle(Kind::connection);
  gimi_connection_event event{};
  event.struct_size = sizeof event;
  const std::int32_t time = c.timeout();
  c.timed(time, [&] { return gimi_connection_receive(events, time, &event); });
}

void take_name(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  const char* const name = c.node_name();
  c.timed(time, [&] { return gimi_take_name(node, name, time); });
}

void give_name_back(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  c.timed(time, [&] { return gimi_give_name_back(node, time); });
}

void flush(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  c.timed(0, [&] { return gimi_flush(node); });
}

void drain(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.timeout();
  c.timed(time, [&] { return gimi_drain(node, time); });
}

void create_wait_set(ApiCaller& c) {
  gimi_handle set = 0;
  c.keep(c.timed(0, [&] { return gimi_wait_set_create(&set); }), set);
}

void add_to_wait_set(ApiCaller& c) {
  const gimi_handle set = c.handle(Kind::wait_set);
  const gimi_handle member = c.handle(static_cast<Kind>(1 + c.below(kKinds)));
  c.timed(0, [&] { return gimi_wait_set_add(set, member, 7); });
}

void remove_from_wait_set(ApiCaller& c) {
  const gimi_handle set = c.handle(Kind::wait_set);
  const gimi_handle member = c.handle(static_cast<Kind>(1 + c.below(kKinds)));
  c.timed(0, [&] { return gimi_wait_set_remove(set, member); });
}

void wait_set_wait(ApiCaller& c) {
  const gimi_handle set = c.handle(Kind::wait_set);
  std::array<gimi_ready, 8> ready{};
  std::size_t count = 0;
  const std::int32_t time = c.timeout();
  c.timed(time, [&] {
    return gimi_wait_set_wait(set, ready.data(), ready.size(), sizeof ready[0], time, &count);
  });
  for (std::size_t i = 0; i < count; ++i) {
    if (c.one_in(16)) static_cast<void>(gimi_wait_set_remove(set, ready.at(i).member));
    gimi_message message{};
    const gimi_handle member = ready.at(i).member;
    if (c.timed(0, [&] { return gimi_receive(member, 0, &message); }) == GIMI_OK) c.take(message);
  }
}

void wake(ApiCaller& c) {
  const gimi_handle set = c.handle(Kind::wait_set);
  c.timed(0, [&] { return gimi_wait_set_wake(set); });
}

void descriptor(ApiCaller& c) {
  const gimi_handle set = c.handle(Kind::wait_set);
  std::int32_t number = -1;
  c.timed(0, [&] { return gimi_wait_set_descriptor(set, &number); });
}

}  // namespace

std::span<const ApiCall> node_calls() {
  static constexpr std::array kCalls{
      ApiCall{"join", join, 8, false},
      ApiCall{"leave", leave, 1},
      ApiCall{"close", close, 12, false},
      ApiCall{"id", id},
      ApiCall{"state", state},
      ApiCall{"lost", lost},
      ApiCall{"watch_connection", watch_connection},
      ApiCall{"connection_receive", connection_receive},
      ApiCall{"take_name", take_name, 6},
      ApiCall{"give_name_back", give_name_back, 2},
      ApiCall{"flush", flush},
      ApiCall{"drain", drain},
      ApiCall{"wait_set_create", create_wait_set, 4, false},
      ApiCall{"wait_set_add", add_to_wait_set, 12},
      ApiCall{"wait_set_remove", remove_from_wait_set},
      ApiCall{"wait_set_wait", wait_set_wait, 16},
      ApiCall{"wait_set_wake", wake},
      ApiCall{"wait_set_descriptor", descriptor},
  };
  return kCalls;
}

}  // namespace gimnet::stress
