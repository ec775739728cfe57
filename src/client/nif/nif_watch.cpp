#include "gimnet/nif_watch.h"

#include <string>

#include "client/nif/api.hpp"
#include "proto/control/ns_register.hpp"
#include "proto/control/ns_watch.hpp"

// The own name, and watching, of the C API.

namespace ns = gimnet::proto::ns;
using gimnet::nif::ask;
using gimnet::nif::check_name;
using gimnet::nif::check_pattern;
using gimnet::nif::deadline_after;
using gimnet::nif::fail;
using gimnet::nif::Node;
using gimnet::nif::with_node;
using gimnet::nif::with_waiting_node;

extern "C" {

nif_status nif_register(nif_node* node, const char* name, int32_t timeout_ms) {
  return with_waiting_node(node, [&](Node& found) -> nif_status {
    if (const nif_status status = check_name(name, "take the name", gimnet::proto::node_name_fault);
        status != NIF_OK)
      return status;
    ns::RegisterNameAnswer answer;
    const nif_status status = ask(found, ns::RegisterName{name}, answer, "take the name", name,
                                  deadline_after(timeout_ms));
    if (status != NIF_OK) return status;
    found.set_name(answer.name, std::move(answer.token));
    return NIF_OK;
  });
}

nif_status nif_unregister(nif_node* node, int32_t timeout_ms) {
  return with_waiting_node(node, [&](Node& found) -> nif_status {
    ns::UnregisterNameAnswer answer;
    const nif_status status = ask(found, ns::UnregisterName{}, answer, "give back", "the name",
                                  deadline_after(timeout_ms));
    if (status == NIF_OK) found.set_name("", std::move(answer.token));
    return status;
  });
}

nif_status nif_watch(nif_node* node, const char* pattern, uint32_t subjects, uint32_t* watch,
                     int32_t timeout_ms) {
  return with_waiting_node(node, [&](Node& found) -> nif_status {
    const bool by_hand = (subjects & NIF_WATCH_BY_HAND) != 0;
    const std::uint32_t set = subjects & ~std::uint32_t{NIF_WATCH_BY_HAND};
    if (watch == nullptr || set < NIF_WATCH_NODES || set > NIF_WATCH_ALL) {
      return fail(NIF_BAD_ARGUMENT,
                  "cannot watch: watch is NULL, or subjects is not a set of nif_subjects");
    }
    if (const nif_status status = check_pattern(pattern); status != NIF_OK) return status;
    const std::string text = pattern != nullptr ? pattern : "";
    const ns::Watch request = found.watches().add(text, static_cast<std::uint8_t>(set), by_hand);
    ns::WatchAnswer answer;
    const nif_status status =
        ask(found, request, answer, "watch", text, deadline_after(timeout_ms));
    if (status != NIF_OK) {
      found.watches().remove(request.watch);
      return status;
    }
    *watch = request.watch;
    return NIF_OK;
  });
}

nif_status nif_watch_again(nif_node* node, uint32_t watch, int32_t timeout_ms) {
  return with_waiting_node(node, [&](Node& found) -> nif_status {
    const ns::Watch request = found.watches().again(watch);
    if (request.watch == 0)
      return fail(NIF_NOT_FOUND, "this node has no watch " + std::to_string(watch));
    ns::WatchAnswer answer;
    return ask(found, request, answer, "watch", request.pattern, deadline_after(timeout_ms));
  });
}

nif_status nif_watch_taken(nif_node* node, uint32_t watch) {
  return with_node(node, [&](Node& found) -> nif_status {
    found.watches().taken(watch);
    return NIF_OK;
  });
}

nif_status nif_unwatch(nif_node* node, uint32_t watch, int32_t timeout_ms) {
  return with_waiting_node(node, [&](Node& found) -> nif_status {
    if (!found.watches().remove(watch)) {
      return fail(NIF_NOT_FOUND, "this node has no watch " + std::to_string(watch));
    }
    ns::UnwatchAnswer answer;
    const nif_status status = ask(found, ns::Unwatch{watch}, answer, "end the watch",
                                  std::to_string(watch), deadline_after(timeout_ms));
    return status == NIF_NOT_FOUND ? NIF_OK
                                   : status;  // it ended with a connection and had not begun again
  });
}

}  // extern "C"
