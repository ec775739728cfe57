#include <algorithm>

#include "client/gimi/api.hpp"
#include "client/gimi/hub_records.hpp"
#include "client/gimi/record_list.hpp"

// The C API: what hubs tell, and changing them.

using namespace gimnet;
using namespace gimnet::gimi;

namespace {

/// Calls `ask` with the node and makes a list of the records that it answers.
template <class Ask>
gimi_status list_with(gimi_handle node, gimi_list* list, const Ask& ask) {
  if (list == nullptr) return is_null("the list");
  *list = {};
  return with_core(node, [&](Core& core) -> gimi_status {
    auto records = ask(core);
    if (!records) return fail(records.failure());
    *list = list_of(std::move(*records));
    return GIMI_OK;
  });
}

/// Calls `ask` with the node and copies the text that it answers.
template <class Ask>
gimi_status text_with(gimi_handle node, char* text, size_t size, const Ask& ask) {
  if (text == nullptr || size == 0) return is_null("the text, or its size,");
  *text = '\0';
  return with_core(node, [&](Core& core) -> gimi_status {
    const Outcome<std::string> words = ask(core);
    if (!words) return fail(words.failure());
    copy_text(*words, text, size);
    return GIMI_OK;
  });
}

}  // namespace

extern "C" {

gimi_status gimi_nodes(gimi_handle node, const char* pattern, int32_t timeout_ms, gimi_list* list) {
  return list_with(node, list, [&](Core& core) {
    return list_nodes(core.node(), text_of(pattern), timeout_of(timeout_ms));
  });
}

gimi_status gimi_services(gimi_handle node, const char* pattern, int32_t timeout_ms,
                          gimi_list* list) {
  return list_with(node, list, [&](Core& core) {
    return list_services(core.node(), text_of(pattern), timeout_of(timeout_ms));
  });
}

gimi_status gimi_watch(gimi_handle node, const char* pattern, uint32_t subjects, int32_t timeout_ms,
                       gimi_handle* watch) {
  if (watch == nullptr) return is_null("gimi_watch(): watch");
  *watch = 0;
  return with<NodeObject>(node, [&](NodeObject& found) -> gimi_status {
    const std::uint32_t known = GIMI_WATCH_NODES | GIMI_WATCH_SERVICES;
    if ((subjects & ~known) != 0)
      return fail(GIMI_BAD_ARGUMENT, "cannot watch: subjects are GIMI_WATCH_* or 0");
    const std::uint32_t wanted = subjects == 0 ? known : subjects;
    const WatchOptions options{(wanted & GIMI_WATCH_NODES) != 0,
                               (wanted & GIMI_WATCH_SERVICES) != 0};
    auto begun = found.core->watches().watch(text_of(pattern), options, timeout_of(timeout_ms));
    if (!begun) return fail(begun.failure());
    return give<WatchObject>(watch, found.core, std::move(*begun));
  });
}

gimi_status gimi_watch_receive(gimi_handle watch, int32_t timeout_ms, gimi_watch_event* event) {
  if (event == nullptr) return is_null("gimi_watch_receive(): event");
  *event = {};
  return with<WatchObject>(watch, [&](WatchObject& found) -> gimi_status {
    auto told = found.watch.queue->receive(timeout_of(timeout_ms));
    if (!told) return fail(told.failure());
    *event = event_of(std::move(*told));
    return GIMI_OK;
  });
}

gimi_status gimi_hub(gimi_handle node, gimi_hub_question question, uint32_t hub_id,
                     int32_t timeout_ms, gimi_list* list) {
  if (list == nullptr) return is_null("the list");
  *list = {};
  const Timeout timeout = timeout_of(timeout_ms);
  const auto who = [&](Core& core) { return Asking{core.node(), hub_id}; };
  switch (question) {
    case GIMI_HUB:
      return list_with(node, list, [&](Core& core) -> Outcome<std::vector<HubRecord>> {
        const auto hub = ask_hub(who(core), timeout);
        if (!hub) return hub.failure();
        return std::vector{*hub};
      });
    case GIMI_HUB_COUNTERS:
      return list_with(node, list, [&](Core& core) { return ask_counters(who(core), timeout); });
    case GIMI_HUB_CONNECTIONS:
      return list_with(node, list, [&](Core& core) { return ask_connections(who(core), timeout); });
    case GIMI_HUB_NETWORK:
      return list_with(node, list, [&](Core& core) { return ask_hubs(who(core), timeout); });
    case GIMI_HUB_LINKS:
      return list_with(node, list, [&](Core& core) { return ask_links(who(core), timeout); });
    case GIMI_HUB_MISSED:
      return list_with(node, list, [&](Core& core) { return ask_missed(who(core), timeout); });
    default:
      return fail(GIMI_BAD_ARGUMENT, "there is no such question to a hub");
  }
}

gimi_status gimi_ping(gimi_handle node, gimi_peer to, gimi_lane lane, const gimi_bytes* echo,
                      int32_t timeout_ms, int64_t* round_trip_ns) {
  if (round_trip_ns == nullptr) return is_null("gimi_ping(): round_trip_ns");
  *round_trip_ns = 0;
  if (echo != nullptr && echo->data == nullptr && echo->size != 0)
    return is_null("gimi_ping(): data of echo");
  return with_core(node, [&](Core& core) -> gimi_status {
    Lane wanted = Lane::normal;
    if (!read_lane(lane, wanted)) return bad_lane(lane);
    if (is_every_node(Peer{to})) {
      return fail(GIMI_BAD_ARGUMENT,
                  Peer{to}.text() + " cannot be pinged: this id means all nodes");
    }
    const auto traced = core.ping(Peer{to}, timeout_of(timeout_ms), wanted, bytes_of(echo), false);
    if (!traced) return fail(traced.failure());
    *round_trip_ns = traced->round_trip_ns;
    return GIMI_OK;
  });
}

gimi_status gimi_trace(gimi_handle node, gimi_peer to, gimi_lane lane, int32_t timeout_ms,
                       int64_t* round_trip_ns, gimi_list* way_back) {
  if (way_back != nullptr) *way_back = {};
  if (round_trip_ns == nullptr) return is_null("gimi_trace(): round_trip_ns");
  *round_trip_ns = 0;
  return list_with(node, way_back, [&](Core& core) -> Outcome<std::vector<TraceHop>> {
    Lane wanted = Lane::normal;
    if (!read_lane(lane, wanted)) return Failure{Status::bad_argument, "there is no such lane"};
    auto traced = core.ping(Peer{to}, timeout_of(timeout_ms), wanted, {}, true);
    if (!traced) return traced.failure();
    *round_trip_ns = traced->round_trip_ns;
    return std::move(traced->way_back);
  });
}

gimi_status gimi_kick(gimi_handle node, gimi_peer peer, const char* reason, int32_t timeout_ms,
                      char* remark, size_t size) {
  return text_with(node, remark, size, [&](Core& core) {
    return kick(core.node(), Peer{peer}, text_of(reason), timeout_of(timeout_ms));
  });
}

gimi_status gimi_reassign(gimi_handle node, gimi_reassignment ids, int32_t timeout_ms) {
  return with_core(node, [&](Core& core) -> gimi_status {
    return answer(reassign(core.node(), Peer{ids.from}, Peer{ids.to}, timeout_of(timeout_ms)));
  });
}

gimi_status gimi_drain_hub(gimi_handle node, int32_t timeout_ms) {
  return with_core(
      node, [&](Core& core) { return answer(drain_hub(core.node(), timeout_of(timeout_ms))); });
}

gimi_status gimi_reload_hub(gimi_handle node, int32_t timeout_ms, gimi_list* changes) {
  return list_with(node, changes,
                   [&](Core& core) { return reload_hub(core.node(), timeout_of(timeout_ms)); });
}

gimi_status gimi_add_link(gimi_handle node, const gimi_link_options* link, int32_t timeout_ms) {
  if (link == nullptr) return is_null("gimi_add_link(): link");
  return with_core(node, [&](Core& core) -> gimi_status {
    return with_options(
        link, "add a link", "gimi_link_options", [&](const auto& given) -> gimi_status {
          if (given.cost > UINT16_MAX)
            return fail(GIMI_BAD_ARGUMENT, "cannot add the link: its cost is more than 65,535");
          const proto::ctrl::LinkAdd wanted{text_of(given.url), text_of(given.name),
                                            static_cast<std::uint16_t>(given.cost),
                                            text_of(given.proxy)};
          return answer(add_link(core.node(), wanted, timeout_of(timeout_ms)));
        });
  });
}

gimi_status gimi_remove_link(gimi_handle node, const char* name, int32_t timeout_ms) {
  return with_core(node, [&](Core& core) -> gimi_status {
    return answer(remove_link(core.node(), text_of(name), timeout_of(timeout_ms)));
  });
}

gimi_status gimi_set_link_cost(gimi_handle node, const char* name, uint32_t cost,
                               int32_t timeout_ms) {
  return with_core(node, [&](Core& core) -> gimi_status {
    if (cost > UINT16_MAX)
      return fail(GIMI_BAD_ARGUMENT, "cannot set the cost of the link: it is more than 65,535");
    return answer(set_link_cost(core.node(), text_of(name), static_cast<std::uint16_t>(cost),
                                timeout_of(timeout_ms)));
  });
}

gimi_status gimi_set_hub_log_level(gimi_handle node, const char* level, int32_t timeout_ms,
                                   char* before, size_t size) {
  return text_with(node, before, size, [&](Core& core) {
    return set_hub_log_level(core.node(), text_of(level), timeout_of(timeout_ms));
  });
}

}  // extern "C"
