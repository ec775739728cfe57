#include "tools/gimnet/record_json.hpp"

namespace gimnet::tool {

const char* text_of(Direction direction) {
  return direction == Direction::accepts ? "accepts" : "provides";
}
std::string delivery_of(const ServiceRecord& service) {
  if (service.delivery == Delivery::sync) return "sync:" + std::to_string(service.window);
  return service.delivery == Delivery::latest ? "latest" : "stream";
}

void write(JsonWriter& json, const NodeRecord& node) {
  json.begin_object().member("id", node.node.text()).member("name", node.name);
  json.member("hub", node.hub_name)
      .member("hub_id", node.hub_id)
      .member("connected", node.connected);
  json.member("description", node.description).member("place", node.place);
  json.member("joined_ms", node.joined_ms).member("services", node.services).end_object();
}

void write(JsonWriter& json, const ServiceRecord& service, std::optional<std::string_view> place) {
  json.begin_object().member("name", service.name).member("node", service.node.text());
  json.member("type", service.key.type).member("instance", service.key.instance);
  json.member("direction", text_of(service.direction)).member("delivery", delivery_of(service));
  json.member("retain", service.retain);
  json.member("group", service.group_id).member("subscribers", service.subscribers);
  json.member("metadata", service.metadata).member("hub", service.hub_name);
  if (place) json.member("place", *place);
  json.end_object();
}

}  // namespace gimnet::tool
