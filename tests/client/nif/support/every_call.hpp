#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "gimnet/nif.h"

// Every function of the C API that takes a handle and answers with a status.

namespace gimnet::nif::test {

struct Call {
  std::string_view name;
  nif_status (*sound)(nif_node* node);  ///< with arguments that are right; does not wait for long
  nif_status (*unsound)(
      nif_node* node);  ///< with NULL for everything else; null: it takes nothing else
  bool waits;           ///< for an answer of the hub: not in the callback
};

// One part of a name, so that the checks of arguments are passed.
inline constexpr std::array<Call, 31> kCalls{{
    {"nif_get_info",
     [](nif_node* node) {
       nif_info info{};
       info.struct_size = sizeof info;
       return nif_get_info(node, &info);
     },
     [](nif_node* node) { return nif_get_info(node, nullptr); }, false},
    {"nif_get_counters",
     [](nif_node* node) {
       nif_counters counters{};
       counters.struct_size = sizeof counters;
       return nif_get_counters(node, &counters);
     },
     [](nif_node* node) { return nif_get_counters(node, nullptr); }, false},
    {"nif_send",
     [](nif_node* node) {
       nif_outgoing message = NIF_OUTGOING_INIT;
       message.to = 7;
       return nif_send(node, &message, 0);
     },
     [](nif_node* node) { return nif_send(node, nullptr, 0); }, false},
    {"nif_send_to", [](nif_node* node) { return nif_send_to(node, 7, "x", 1); },
     [](nif_node* node) { return nif_send_to(node, 7, nullptr, 1); }, false},
    {"nif_flush", nif_flush, nullptr, false},
    {"nif_drain", [](nif_node* node) { return nif_drain(node, 0); }, nullptr, true},
    {"nif_receive",
     [](nif_node* node) {
       nif_incoming in{};
       const nif_status status = nif_receive(node, &in, 0);
       if (status == NIF_OK) nif_release(&in);
       return status;
     },
     [](nif_node* node) { return nif_receive(node, nullptr, 0); }, false},
    {"nif_receive_many",
     [](nif_node* node) {
       nif_incoming in{};
       std::size_t count = 0;
       const nif_status status = nif_receive_many(node, &in, 1, &count, 0);
       if (status == NIF_OK) nif_release(&in);
       return status;
     },
     [](nif_node* node) { return nif_receive_many(node, nullptr, 1, nullptr, 0); }, false},
    {"nif_deliver", nif_deliver, nullptr, false},
    {"nif_resolve",
     [](nif_node* node) {
       std::uint32_t id = 0;
       return nif_resolve(node, "a", &id, 0);
     },
     [](nif_node* node) { return nif_resolve(node, nullptr, nullptr, 0); }, true},
    {"nif_reverse",
     [](nif_node* node) {
       std::array<char, NIF_NAME_BYTES_MAX + 1> name{};
       return nif_reverse(node, 7, name.data(), 0);
     },
     [](nif_node* node) { return nif_reverse(node, 7, nullptr, 0); }, true},
    {"nif_list_nodes",
     [](nif_node* node) {
       nif_node_list* list = nullptr;
       return nif_list_nodes(node, nullptr, &list, 0);
     },
     [](nif_node* node) { return nif_list_nodes(node, nullptr, nullptr, 0); }, true},
    {"nif_list_services",
     [](nif_node* node) {
       nif_service_list* list = nullptr;
       return nif_list_services(node, nullptr, &list, 0);
     },
     [](nif_node* node) { return nif_list_services(node, nullptr, nullptr, 0); }, true},
    {"nif_advertise",
     [](nif_node* node) {
       nif_service service{};
       service.struct_size = sizeof service;
       service.name = "a";
       std::uint32_t group = 0;
       return nif_advertise(node, &service, &group, nullptr, 0);
     },
     [](nif_node* node) { return nif_advertise(node, nullptr, nullptr, nullptr, 0); }, true},
    {"nif_withdraw", [](nif_node* node) { return nif_withdraw(node, 7, 0); }, nullptr, true},
    {"nif_withdraw_service", [](nif_node* node) { return nif_withdraw_service(node, "a", 0); },
     [](nif_node* node) { return nif_withdraw_service(node, nullptr, 0); }, true},
    {"nif_subscribe", [](nif_node* node) { return nif_subscribe(node, "a/b", nullptr, 0); },
     [](nif_node* node) { return nif_subscribe(node, nullptr, nullptr, 0); }, true},
    {"nif_subscribe_paced",
     [](nif_node* node) { return nif_subscribe_paced(node, "a/b", nullptr, nullptr, 0); },
     [](nif_node* node) { return nif_subscribe_paced(node, nullptr, nullptr, nullptr, 0); }, true},
    {"nif_credit", [](nif_node* node) { return nif_credit(node, 7, 1, 1, 0); }, nullptr, false},
    {"nif_unsubscribe", [](nif_node* node) { return nif_unsubscribe(node, "a/b", 0); },
     [](nif_node* node) { return nif_unsubscribe(node, nullptr, 0); }, true},
    {"nif_request",
     [](nif_node* node) {
       nif_reply* reply = nullptr;
       return nif_request(node, NIF_CTRL, NIF_CTRL_HUB_INFO, nullptr, 0, &reply, 0);
     },
     [](nif_node* node) {
       return nif_request(node, NIF_CTRL, NIF_CTRL_HUB_INFO, nullptr, 5, nullptr, 0);
     },
     true},
    {"nif_request_of_hub",
     [](nif_node* node) {
       nif_reply* reply = nullptr;
       return nif_request_of_hub(node, 0, NIF_CTRL, NIF_CTRL_HUB_INFO, nullptr, 0, &reply, 0);
     },
     [](nif_node* node) {
       nif_reply* reply = nullptr;
       return nif_request_of_hub(node, 4'095, NIF_CTRL, NIF_CTRL_HUB_INFO, nullptr, 0, &reply, 0);
     },
     true},
    {"nif_ping_hub", [](nif_node* node) { return nif_ping_hub(node, nullptr, nullptr, 0); },
     nullptr, true},
    {"nif_register", [](nif_node* node) { return nif_register(node, "a", 0); },
     [](nif_node* node) { return nif_register(node, nullptr, 0); }, true},
    {"nif_unregister", [](nif_node* node) { return nif_unregister(node, 0); }, nullptr, true},
    {"nif_watch",
     [](nif_node* node) {
       std::uint32_t watch = 0;
       return nif_watch(node, nullptr, NIF_WATCH_ALL, &watch, 0);
     },
     [](nif_node* node) { return nif_watch(node, nullptr, NIF_WATCH_ALL, nullptr, 0); }, true},
    {"nif_watch_again", [](nif_node* node) { return nif_watch_again(node, 7, 0); }, nullptr, true},
    {"nif_watch_taken", [](nif_node* node) { return nif_watch_taken(node, 7); }, nullptr, false},
    {"nif_unwatch", [](nif_node* node) { return nif_unwatch(node, 7, 0); }, nullptr, true},
    {"nif_id", [](nif_node* node) { return nif_id(node) == 0 ? NIF_CLOSED : NIF_OK; }, nullptr,
     false},
    {"nif_event_fd", [](nif_node* node) { return nif_event_fd(node) < 0 ? NIF_CLOSED : NIF_OK; },
     nullptr, false},
}};

}  // namespace gimnet::nif::test
