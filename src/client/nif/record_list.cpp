#include "client/nif/record_list.hpp"

#include <algorithm>
#include <array>
#include <memory>
#include <span>
#include <utility>

#include "base/endian.hpp"

namespace gimnet::nif {
namespace {

struct OwnedNodes : nif_node_list {
  std::vector<proto::ns::NodeRecord> owned;
  std::vector<nif_node_record> views;
};

struct OwnedServices : nif_service_list {
  std::vector<proto::ns::ServiceRecord> owned;
  std::vector<nif_service_record> views;
};

}  // namespace

nif_node_record view_of(const proto::ns::NodeRecord& record) {
  nif_node_record view{};
  view.id = record.node.value();
  view.hub_id = record.hub.value();
  view.services = record.services;
  view.connected = record.connected ? 1 : 0;
  view.joined_ms = record.joined_ms;
  view.name = record.name.c_str();
  view.hub_name = record.hub_name.c_str();
  view.description = record.description.c_str();
  view.place = record.place.c_str();
  return view;
}

nif_service_record view_of(const proto::ns::ServiceRecord& record) {
  nif_service_record view{};
  view.group = record.group.value();
  view.node_id = record.node.value();
  view.message_type = record.message_type;
  view.instance = record.instance;
  view.subscribers = record.subscribers;
  view.direction = static_cast<std::uint8_t>(record.direction);
  view.delivery = static_cast<std::uint8_t>(record.delivery);
  view.name = record.name.c_str();
  view.metadata = record.metadata.c_str();
  view.window = record.window;
  view.retain = record.retain ? 1 : 0;
  view.missed = record.missed;
  view.missed_most = record.missed_most.value();
  view.hub_name = record.hub_name.c_str();
  return view;
}

nif_node_list* make_node_list(std::vector<proto::ns::NodeRecord> records) {
  auto list = std::make_unique<OwnedNodes>();
  list->owned = std::move(records);
  for (const auto& record : list->owned) list->views.push_back(view_of(record));
  list->count = list->views.size();
  list->records = list->views.data();
  return list.release();
}

nif_service_list* make_service_list(std::vector<proto::ns::ServiceRecord> records) {
  auto list = std::make_unique<OwnedServices>();
  list->owned = std::move(records);
  for (const auto& record : list->owned) list->views.push_back(view_of(record));
  list->count = list->views.size();
  list->records = list->views.data();
  return list.release();
}

Record* make_event(nif_incoming_type type, std::string text) {
  auto record = std::make_unique<Record>();
  record->incoming.type = type;
  record->text = std::move(text);
  record->finish();
  return record.release();
}

Record* make_report(const proto::Report& report, std::uint32_t from) {
  const proto::FrameHeader& header = report.header;
  Record* record = make_event(NIF_REPORT, proto::drop_reason_name(report.reason));
  nif_incoming& in = record->incoming;
  in.from = from;
  in.reason = static_cast<std::uint32_t>(report.reason);
  // The question of this library that is the last of them is not one of the program's messages.
  in.count = header.kind == proto::Kind::taken ? report.count - 1 : report.count;
  in.to = header.dst;
  in.kind = static_cast<std::uint8_t>(header.kind);
  in.lane = header.lane & proto::kLaneMask;
  in.policy = static_cast<std::uint8_t>(header.policy());
  const bool plain = !header.has(proto::kFlagExt | proto::kFlagFragment);
  if (plain && header.has(proto::kFlagKeyed) && report.following.size() >= sizeof(std::uint64_t)) {
    in.key = load_le<std::uint64_t>(report.following.data());
    in.flags = NIF_FLAG_KEYED;
  }
  std::array<std::byte, proto::kReportSizeMax> whole;
  const std::size_t size = proto::encode_report(report, whole);
  if (record->payload.append(std::span(whole).first(size).subspan(8))) record->finish();
  return record;
}

Record* make_too_large(const nif_incoming& begun, std::span<const std::byte> payload) {
  constexpr auto kReason = proto::DropReason::too_large;
  Record* record = make_event(NIF_GAP, proto::drop_reason_name(kReason));
  nif_incoming& in = record->incoming;
  in = begun;
  in.type = NIF_GAP;
  in.count = 1;
  in.reason = static_cast<std::uint32_t>(kReason);
  in.payload = in.extensions = nullptr;
  in.size = in.extensions_size = 0;
  static_cast<void>(record->payload.append(payload.first(std::min(payload.size(), kBeginningMax))));
  record->finish();
  return record;
}

Item item_of(Record* record, std::size_t bytes) {
  return {record, nullptr, 0, bytes + sizeof(Record), 0};
}

void put_service(nif_incoming& incoming, const proto::ns::ServiceState& state) {
  incoming.group = state.group.value();
  incoming.from = state.provider.value();
  incoming.count = state.session;
  incoming.message_type = state.message_type;
  incoming.instance = state.instance;
  incoming.delivery = static_cast<std::uint32_t>(state.delivery);
  incoming.direction = static_cast<std::uint32_t>(state.direction);
  incoming.flags = state.away ? NIF_SERVICE_AWAY : 0;
}

}  // namespace gimnet::nif

extern "C" void nif_free_nodes(nif_node_list* list) {
  delete static_cast<gimnet::nif::OwnedNodes*>(list);
}
extern "C" void nif_free_services(nif_service_list* list) {
  delete static_cast<gimnet::nif::OwnedServices*>(list);
}
