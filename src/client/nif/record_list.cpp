#include "client/nif/record_list.hpp"

#include <memory>
#include <utility>

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

}  // namespace gimnet::nif

extern "C" void nif_free_nodes(nif_node_list* list) {
  delete static_cast<gimnet::nif::OwnedNodes*>(list);
}
extern "C" void nif_free_services(nif_service_list* list) {
  delete static_cast<gimnet::nif::OwnedServices*>(list);
}
