#include "gimnet/nif_names.h"

#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/ids.hpp"
#include "client/nif/api.hpp"
#include "client/nif/record_list.hpp"
#include "client/nif/sized_struct.hpp"
#include "proto/control/names.hpp"
#include "proto/control/ns.hpp"

// Names, services and raw requests of the C API.

namespace ns = gimnet::proto::ns;
namespace proto = gimnet::proto;
using gimnet::GroupId;
using gimnet::NodeId;
using gimnet::steady_now_ns;
using gimnet::nif::ask;
using gimnet::nif::check_name;
using gimnet::nif::check_pattern;
using gimnet::nif::Deadline;
using gimnet::nif::deadline_after;
using gimnet::nif::fail;
using gimnet::nif::Node;
using gimnet::nif::read_struct;
using gimnet::nif::with_waiting_node;

namespace {

nif_status impossible_answer() {
  return fail(NIF_PROTOCOL, "the hub's answer is not in ascending order");
}

/// All pages of a listing. `id_of` reads a record's id.
template <class Request, class Answer, class Record, class IdOf>
nif_status list_pages(Node& node, Request request, std::vector<Record> Answer::* page, IdOf id_of,
                      std::vector<Record>& records, Deadline deadline) {
  for (;;) {
    Answer answer;
    const nif_status status = ask(node, request, answer, "list", request.pattern, deadline);
    if (status != NIF_OK) return status;
    auto last = request.after;
    for (Record& record : answer.*page) {
      // Ascending, or a hub could page for ever.
      if (!(last < id_of(record))) return impossible_answer();
      last = id_of(record);
      records.push_back(std::move(record));
    }
    if (!answer.more) return NIF_OK;
    if (answer.next < last || !(request.after < answer.next)) return impossible_answer();
    request.after = answer.next;
  }
}

/// Asks and enters the outcome by `once`. The library declares again, at each connection anew, what
/// had been entered by then; so what was answered before such a moment and entered behind it is
/// asked once more.
template <class Once>
nif_status declare(Node& node, Once once) {
  bool done = false;
  for (;;) {
    const std::uint32_t before = node.record().info().reconnects;
    const nif_status status = once();
    if (status == NIF_NOT_FOUND && done) return NIF_OK;  // ended twice
    if (status != NIF_OK || before == node.record().info().reconnects) return status;
    done = true;
  }
}

struct OwnedReply : nif_reply {
  proto::Payload payload;
  std::string text;
};

}  // namespace

extern "C" {

nif_status nif_resolve(nif_node* node, const char* name, uint32_t* id, int32_t timeout_ms) {
  return with_waiting_node(node, [&](Node& found) -> nif_status {
    if (id == nullptr) return fail(NIF_BAD_ARGUMENT, "cannot resolve: id is NULL");
    if (const nif_status status = check_name(name, "resolve"); status != NIF_OK) return status;
    if (const auto known = found.names().id_of(name, steady_now_ns())) {
      *id = *known;
      return NIF_OK;
    }
    ns::ResolveAnswer answer;
    const nif_status status =
        ask(found, ns::Resolve{name}, answer, "resolve", name, deadline_after(timeout_ms));
    if (status != NIF_OK) return status;
    *id = answer.node.value();
    found.names().remember(name, *id, steady_now_ns());
    return NIF_OK;
  });
}

nif_status nif_reverse(nif_node* node, uint32_t id, char* name, int32_t timeout_ms) {
  return with_waiting_node(node, [&](Node& found) -> nif_status {
    if (name == nullptr) return fail(NIF_BAD_ARGUMENT, "cannot look a node up: name is NULL");
    auto known = found.names().name_of(id, steady_now_ns());
    if (!known) {
      ns::ReverseAnswer answer;
      const nif_status status = ask(found, ns::Reverse{NodeId{id}}, answer, "look up the node",
                                    gimnet::to_string(NodeId{id}), deadline_after(timeout_ms));
      if (status != NIF_OK) return status;
      if (answer.name.size() > NIF_NAME_BYTES_MAX)
        return fail(NIF_PROTOCOL, "the hub's answer has too long a name");
      found.names().remember(answer.name, id, steady_now_ns());
      known = std::move(answer.name);
    }
    std::memcpy(name, known->c_str(), known->size() + 1);
    return NIF_OK;
  });
}

nif_status nif_list_nodes(nif_node* node, const char* pattern, nif_node_list** list,
                          int32_t timeout_ms) {
  if (list != nullptr) *list = nullptr;
  return with_waiting_node(node, [&](Node& found) -> nif_status {
    if (list == nullptr) return fail(NIF_BAD_ARGUMENT, "cannot list: list is NULL");
    if (const nif_status status = check_pattern(pattern); status != NIF_OK) return status;
    std::vector<ns::NodeRecord> records;
    ns::List request;
    request.pattern = pattern != nullptr ? pattern : "";
    const nif_status status = list_pages(
        found, request, &ns::ListAnswer::nodes,
        [](const ns::NodeRecord& record) { return record.node; }, records,
        deadline_after(timeout_ms));
    if (status == NIF_OK) *list = gimnet::nif::make_node_list(std::move(records));
    return status;
  });
}

nif_status nif_list_services(nif_node* node, const char* pattern, nif_service_list** list,
                             int32_t timeout_ms) {
  if (list != nullptr) *list = nullptr;
  return with_waiting_node(node, [&](Node& found) -> nif_status {
    if (list == nullptr) return fail(NIF_BAD_ARGUMENT, "cannot list: list is NULL");
    if (const nif_status status = check_pattern(pattern); status != NIF_OK) return status;
    std::vector<ns::ServiceRecord> records;
    ns::ServicesRequest request;
    request.pattern = pattern != nullptr ? pattern : "";
    const nif_status status = list_pages(
        found, request, &ns::ServicesAnswer::services,
        [](const ns::ServiceRecord& record) { return record.group; }, records,
        deadline_after(timeout_ms));
    if (status == NIF_OK) *list = gimnet::nif::make_service_list(std::move(records));
    return status;
  });
}

nif_status nif_advertise(nif_node* node, const nif_service* service, uint32_t* group,
                         uint32_t* subscribers, int32_t timeout_ms) {
  return with_waiting_node(node, [&](Node& found) -> nif_status {
    if (service == nullptr || group == nullptr)
      return fail(NIF_BAD_ARGUMENT, "cannot advertise: service or group is NULL");
    nif_service whole;
    const nif_service* known = service;
    if (auto failure = read_struct(known, whole, "advertise", "nif_service")) return fail(*failure);
    if (known->direction > NIF_ACCEPTS || known->delivery > NIF_SYNC_DELIVERY) {
      return fail(NIF_BAD_ARGUMENT,
                  "cannot advertise: direction or delivery is not one of its enumeration");
    }
    if (const nif_status status = check_name(known->name, "offer"); status != NIF_OK) return status;
    ns::Advertise request;
    request.service = known->name;
    request.message_type = known->message_type;
    request.instance = known->instance;
    request.direction = static_cast<ns::Direction>(known->direction);
    request.delivery = static_cast<ns::Delivery>(known->delivery);
    request.metadata = known->metadata != nullptr ? known->metadata : "";
    if (request.metadata.size() > proto::kMetadataBytesMax)
      return fail(NIF_BAD_ARGUMENT, "cannot advertise: the metadata is over 4,096 bytes");
    request.window = known->window;
    request.retain = known->retain != 0;
    if (!proto::valid_service_name(request.service)) {
      return fail(NIF_BAD_NAME,
                  "cannot offer '" + request.service + "': a service's name has one part");
    }
    ns::AdvertiseAnswer answer;
    const Deadline deadline = deadline_after(timeout_ms);
    const bool ended = found.declarations().begin_service(request.service);
    const nif_status status = declare(found, [&] {
      const nif_status asked = ask(found, request, answer, "advertise", request.service, deadline);
      if (asked == NIF_OK) found.declarations().add_service(request, answer.group);
      return asked;
    });
    if (status != NIF_OK) {
      if (ended) static_cast<void>(found.declarations().end_service(request.service));
      return status;
    }
    *group = answer.group.value();
    if (subscribers != nullptr) *subscribers = answer.subscribers;
    return NIF_OK;
  });
}

nif_status nif_withdraw(nif_node* node, uint32_t group, int32_t timeout_ms) {
  return with_waiting_node(node, [&](Node& found) -> nif_status {
    if (group == 0)
      return fail(NIF_BAD_ARGUMENT,
                  "cannot withdraw the service: group is 0, which no service has");
    ns::WithdrawAnswer answer;
    const Deadline deadline = deadline_after(timeout_ms);
    return declare(found, [&] {
      const nif_status status =
          ask(found, ns::Withdraw{GroupId{group}}, answer, "withdraw the service",
              gimnet::to_string(GroupId{group}), deadline);
      if (status == NIF_OK || status == NIF_NOT_FOUND)
        found.declarations().remove_service(GroupId{group});
      return status;
    });
  });
}

nif_status nif_withdraw_service(nif_node* node, const char* name, int32_t timeout_ms) {
  return with_waiting_node(node, [&](Node& found) -> nif_status {
    if (const nif_status status = check_name(name, "withdraw"); status != NIF_OK) return status;
    const std::optional<GroupId> group = found.declarations().end_service(name);
    if (!group)
      return fail(NIF_NOT_FOUND,
                  "cannot withdraw '" + std::string(name) + "': this node has no such service");
    if (*group == GroupId{}) return NIF_OK;
    ns::WithdrawAnswer answer;
    const nif_status status =
        ask(found, ns::Withdraw{*group}, answer, "withdraw", name, deadline_after(timeout_ms));
    if (status != NIF_OK && status != NIF_NOT_FOUND) return status;
    found.declarations().finish_service(name, *group);
    return NIF_OK;
  });
}

nif_status nif_subscribe(nif_node* node, const char* full_name, nif_subscription* subscription,
                         int32_t timeout_ms) {
  return nif_subscribe_paced(node, full_name, nullptr, subscription, timeout_ms);
}

nif_status nif_credit(nif_node* node, uint32_t group, uint32_t epoch, uint32_t messages, int more) {
  return gimnet::nif::with_node(node, [&](Node& found) -> nif_status {
    found.credits().take(group, epoch, messages, more != 0);
    return NIF_OK;
  });
}

nif_status nif_subscribe_paced(nif_node* node, const char* full_name, const nif_pace* pace,
                               nif_subscription* subscription, int32_t timeout_ms) {
  return with_waiting_node(node, [&](Node& found) -> nif_status {
    nif_pace whole;
    if (pace != nullptr) {
      if (auto failure = read_struct(pace, whole, "subscribe", "nif_pace")) return fail(*failure);
    }
    if (const nif_status status =
            check_name(full_name, "subscribe to", proto::service_full_name_fault);
        status != NIF_OK)
      return status;
    ns::Subscribe request{full_name};
    if (pace != nullptr) {
      request.window = pace->window;
      request.depth = pace->depth != 0 ? pace->depth : 1;
      request.rate_hz = pace->rate_hz;
    }
    ns::SubscribeAnswer answer;
    const Deadline deadline = deadline_after(timeout_ms);
    const gimnet::nif::Declarations::Subscribing subscribing(found.declarations());
    const auto former = found.declarations().begin_subscription(request);
    bool again = false;
    const nif_status status = declare(found, [&] {
      // An answer that was lost with its connection began counts that this end does not know.
      if (std::exchange(again, true)) found.declarations().count_anew(request);
      const nif_status asked = ask(found, request, answer, "subscribe to", full_name, deadline);
      if (asked == NIF_OK) found.declarations().add_subscription(request, answer);
      return asked;
    });
    if (status != NIF_OK) {
      const bool heard = status != NIF_TIMEOUT && status != NIF_NOT_CONNECTED;
      found.declarations().give_up_subscription(full_name, former, heard);
      return status;
    }
    if (subscription != nullptr) {
      *subscription = {answer.group.value(),
                       answer.message_type,
                       answer.instance,
                       static_cast<std::uint32_t>(answer.delivery),
                       answer.window,
                       answer.retain ? 1u : 0u,
                       static_cast<std::uint32_t>(answer.direction),
                       answer.provider.value(),
                       answer.session};
    }
    return NIF_OK;
  });
}

nif_status nif_unsubscribe(nif_node* node, const char* full_name, int32_t timeout_ms) {
  return with_waiting_node(node, [&](Node& found) -> nif_status {
    if (const nif_status status = check_name(full_name, "unsubscribe"); status != NIF_OK)
      return status;
    ns::UnsubscribeAnswer answer;
    const Deadline deadline = deadline_after(timeout_ms);
    // A reconnect declares by what is entered, so that this needs to be asked once only.
    const bool ended = found.declarations().end_subscription(full_name);
    const nif_status status =
        ask(found, ns::Unsubscribe{full_name}, answer, "unsubscribe", full_name, deadline);
    if (status == NIF_OK || status == NIF_NOT_FOUND)
      found.declarations().finish_subscription(full_name);
    // The library may have told the hub before.
    return status == NIF_NOT_FOUND && ended ? NIF_OK : status;
  });
}

nif_status nif_request(nif_node* node, uint8_t kind, uint16_t operation, const void* content,
                       size_t size, nif_reply** reply, int32_t timeout_ms) {
  return nif_request_of_hub(node, 0, kind, operation, content, size, reply, timeout_ms);
}

nif_status nif_request_of_hub(nif_node* node, uint32_t hub_id, uint8_t kind, uint16_t operation,
                              const void* content, size_t size, nif_reply** reply,
                              int32_t timeout_ms) {
  if (reply != nullptr) *reply = nullptr;
  return with_waiting_node(node, [&](Node& found) -> nif_status {
    if (reply == nullptr || (content == nullptr && size > 0)) {
      return fail(NIF_BAD_ARGUMENT, "cannot ask: reply or content is NULL");
    }
    if ((kind != NIF_NS && kind != NIF_CTRL) || operation >= proto::kAnswerBit ||
        size > NIF_REQUEST_BYTES_MAX || hub_id > gimnet::kHubIdMax) {
      return fail(NIF_BAD_ARGUMENT, "cannot ask: hub, kind, operation or size is out of range");
    }
    proto::Payload request(proto::kControlHeaderSize + size);
    gimnet::store_le(request.data(), operation);
    if (size > 0) std::memcpy(request.data() + proto::kControlHeaderSize, content, size);
    auto owned = std::make_unique<OwnedReply>();
    const nif_status status = found.requests().ask(
        static_cast<proto::Kind>(kind), request, owned->payload, deadline_after(timeout_ms),
        gimnet::HubId{static_cast<std::uint16_t>(hub_id)});
    if (status != NIF_OK) return status;
    const auto body = std::span<const std::byte>(owned->payload).subspan(proto::kControlHeaderSize);
    const proto::Refusal refusal = proto::read_status(body);
    owned->status = static_cast<std::uint16_t>(refusal.status);
    owned->text = refusal.sentence;
    owned->sentence = owned->text.c_str();
    owned->content = body.data();
    owned->size = body.size();
    *reply = owned.release();
    return NIF_OK;
  });
}

void nif_free_reply(nif_reply* reply) { delete static_cast<OwnedReply*>(reply); }

nif_status nif_ping_hub(nif_node* node, int64_t* round_trip_ns, int64_t* clock_offset_ns,
                        int32_t timeout_ms) {
  return with_waiting_node(node, [&](Node& found) -> nif_status {
    gimnet::nif::HubClock::Measurement measured;
    const nif_status status = found.ping_hub(measured, deadline_after(timeout_ms));
    if (status != NIF_OK) return status;
    if (round_trip_ns != nullptr) *round_trip_ns = measured.round_trip_ns;
    if (clock_offset_ns != nullptr) *clock_offset_ns = measured.offset_ns;
    return NIF_OK;
  });
}

}  // extern "C"
