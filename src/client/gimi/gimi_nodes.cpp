#include "client/gimi/api.hpp"

// The C API: nodes, their names, and their state.

using namespace gimnet;
using namespace gimnet::gimi;

namespace {

Outcome<NodeOptions> read(const gimi_node_options& given) {
  if (given.credentials != nullptr) {
    return Failure{Status::bad_argument,
                   "cannot join: this version of the library knows no credentials"};
  }
  NodeOptions options;
  options.name = text_of(given.name);
  options.hub = text_of(given.hub);
  options.description = text_of(given.description);
  options.proxy = text_of(given.proxy);
  options.timeout = timeout_in_options(given.timeout_ms);
  options.wait_for_hub = given.wait_for_hub != 0;
  options.reconnect = given.no_reconnect == 0;
  if (given.resume > 2)
    return Failure{Status::bad_argument, "cannot join: resume is none of 0, 1 and 2"};
  if (given.resume != 0) options.resume = given.resume == 2;
  options.keep_token = given.no_token_file == 0;
  if (given.shard_plus_one != 0)
    options.shard = static_cast<std::uint8_t>(given.shard_plus_one - 1);
  options.administrator = given.administrator != 0;
  options.number_if_taken = given.number_if_taken != 0;
  options.socket_receive_bytes = given.socket_receive_bytes;
  if (given.last_message_bytes != 0) options.last_message_bytes = given.last_message_bytes;
  if (given.message_bytes_max > GIMI_MESSAGE_BYTES_MAX)
    return Failure{Status::bad_argument, "cannot join: message_bytes_max is over 1 GiB"};
  if (given.queue_messages > GIMI_QUEUE_MESSAGES_MAX)
    return Failure{Status::bad_argument, "cannot join: " + too_long(given.queue_messages)};
  if (given.message_bytes_max != 0) options.message_bytes_max = given.message_bytes_max;
  if (given.receive_bytes != 0) options.receive_bytes = given.receive_bytes;
  if (given.queue_messages != 0) options.queue_messages = given.queue_messages;
  return options;
}

/// Calls NIF with the node and answers its status; `doing` as in "take the name 'x'".
template <class Call>
gimi_status ask_nif(gimi_handle node, const std::string& doing, const Call& call) {
  return with_core(node, [&](Core& core) -> gimi_status {
    const nif_status status = call(core);
    return status == NIF_OK ? GIMI_OK : fail(failure_of(status, doing));
  });
}

}  // namespace

extern "C" {

gimi_status gimi_join(const gimi_node_options* options, gimi_handle* node) {
  if (node == nullptr) return is_null("gimi_join(): node");
  *node = 0;
  return guarded([&] {
    return with_options(options, "join", "gimi_node_options", [&](const auto& given) {
      const auto read_options = read(given);
      if (!read_options) return fail(read_options.failure());
      auto core = Core::join(*read_options);
      if (!core) return fail(core.failure());
      return give<NodeObject>(node, std::move(*core));
    });
  });
}

gimi_status gimi_leave(gimi_handle node) {
  return with_core(node, [](Core& core) -> gimi_status {
    core.close();
    return GIMI_OK;
  });
}

gimi_status gimi_close(gimi_handle handle) {
  try {
    return close_object(handle);
  } catch (const std::exception&) {
    return GIMI_SYSTEM;  // it has no sentence, as every answer of this function
  }
}

gimi_peer gimi_id(gimi_handle node) {
  gimi_peer id = 0;
  static_cast<void>(with_core(node, [&](Core& core) -> gimi_status {
    id = nif_id(core.node());
    return GIMI_OK;
  }));
  return id;
}

gimi_status gimi_state(gimi_handle node, gimi_node_state* state) {
  return with_core(node, [&](Core& core) -> gimi_status {
    if (!nif::has_size(state)) return is_null("gimi_state(): state, or its struct_size,");
    const NodeState now = core.state();
    gimi_node_state whole{};
    whole.id = now.peer.id;
    whole.hub_id = now.hub_id;
    whole.reconnects = now.reconnects;
    whole.connected = now.connected ? 1 : 0;
    whole.ended = now.ended ? 1 : 0;
    whole.hub_round_trip_ns = now.hub_round_trip_ns;
    whole.hub_clock_offset_ns = now.hub_clock_offset_ns;
    whole.last_messages_not_kept = now.last_messages_not_kept;
    copy_text(now.name, whole.name, sizeof whole.name);
    copy_text(now.hub_name, whole.hub_name, sizeof whole.hub_name);
    copy_text(now.trouble, whole.trouble, sizeof whole.trouble);
    nif::write_struct(whole, *state);
    return GIMI_OK;
  });
}

gimi_status gimi_watch_connection(gimi_handle node, gimi_handle* events) {
  if (events == nullptr) return is_null("gimi_watch_connection(): events");
  *events = 0;
  return with<NodeObject>(node, [&](NodeObject& found) {
    return give<ConnectionObject>(events, found.core, found.core->connection().begin());
  });
}

gimi_status gimi_connection_receive(gimi_handle events, int32_t timeout_ms,
                                    gimi_connection_event* event) {
  return with<ConnectionObject>(events, [&](ConnectionObject& found) -> gimi_status {
    if (!nif::has_size(event))
      return is_null("gimi_connection_receive(): event, or its struct_size,");
    const auto told = found.queue->receive(timeout_of(timeout_ms));
    if (!told) return fail(told.failure());
    gimi_connection_event whole{};
    whole.change = static_cast<gimi_connection_change>(told->change);
    whole.skipped = told->skipped;
    whole.when_ns = told->when_ns;
    copy_text(told->why, whole.why, sizeof whole.why);
    nif::write_struct(whole, *event);
    return GIMI_OK;
  });
}

gimi_status gimi_lost(gimi_handle node, gimi_lost_counts* counts) {
  return with_core(node, [&](Core& core) -> gimi_status {
    if (!nif::has_size(counts)) return is_null("gimi_lost(): counts, or its struct_size,");
    const LostCounts lost = core.lost();
    const gimi_lost_counts whole{sizeof whole,
                                 core.inbox().dropped() + core.requests().dropped(),
                                 lost.incomplete,
                                 lost.too_large,
                                 lost.frames_broken_off,
                                 lost.unknown_service,
                                 lost.unreadable,
                                 lost.outdated,
                                 lost.queue_full,
                                 lost.queue_filled_by.id,
                                 0,
                                 lost.over_budget};
    nif::write_struct(whole, *counts);
    return GIMI_OK;
  });
}

gimi_status gimi_take_name(gimi_handle node, const char* name, int32_t timeout_ms) {
  if (name == nullptr) return is_null("gimi_take_name(): name");
  return ask_nif(node, "take the name '" + text_of(name) + "'", [&](Core& core) {
    const nif_status status = nif_register(core.node(), name, timeout_ms);
    if (status == NIF_OK) core.on_renamed();
    return status;
  });
}

gimi_status gimi_give_name_back(gimi_handle node, int32_t timeout_ms) {
  return ask_nif(node, "give the name back", [&](Core& core) {
    const nif_status status = nif_unregister(core.node(), timeout_ms);
    if (status == NIF_OK) core.on_renamed();
    return status;
  });
}

gimi_status gimi_flush(gimi_handle node) {
  return ask_nif(node, "write what was held back",
                 [](Core& core) { return nif_flush(core.node()); });
}

gimi_status gimi_drain(gimi_handle node, int32_t timeout_ms) {
  return ask_nif(node, "write what waits",
                 [&](Core& core) { return nif_drain(core.node(), timeout_ms); });
}

gimi_status gimi_find(gimi_handle node, const char* name, int32_t timeout_ms, gimi_peer* peer) {
  if (peer != nullptr) *peer = 0;
  if (name == nullptr || peer == nullptr) return is_null("gimi_find(): name or peer");
  return ask_nif(node, "find the node '" + text_of(name) + "'", [&](Core& core) {
    const auto id = Peer::parse(name);
    if (!id) return nif_resolve(core.node(), name, peer, timeout_ms);
    *peer = id->id;
    return NIF_OK;
  });
}

gimi_status gimi_name_of(gimi_handle node, gimi_peer peer, int32_t timeout_ms, char* name,
                         size_t size) {
  if (name == nullptr || size == 0) return is_null("gimi_name_of(): name, or its size,");
  *name = '\0';
  return ask_nif(node, "find the name of " + Peer{peer}.text(), [&](Core& core) {
    std::string whole(NIF_NAME_BYTES_MAX + 1, '\0');
    const nif_status status = nif_reverse(core.node(), peer, whole.data(), timeout_ms);
    if (status == NIF_OK) copy_text(whole.c_str(), name, size);
    return status;
  });
}

}  // extern "C"
