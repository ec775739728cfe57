#include "tools/gimnet/commands.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {
namespace {

const char* text_of(Direction direction) { return direction == Direction::accepts ? "accepts" : "provides"; }
std::string delivery_of(const ServiceRecord& service) {
  if (service.delivery == Delivery::sync) return "sync:" + std::to_string(service.window);
  return service.delivery == Delivery::latest ? "latest" : "stream";
}

std::string json_of(const std::vector<ServiceRecord>& services) {
  JsonWriter json;
  json.begin_array();
  for (const ServiceRecord& service : services) {
    json.begin_object().member("name", service.name).member("node", service.node.text());
    json.member("type", service.key.type).member("instance", service.key.instance);
    json.member("direction", text_of(service.direction)).member("delivery", delivery_of(service));
    json.member("retain", service.retain);
    json.member("group", service.group_id).member("subscribers", service.subscribers);
    json.member("metadata", service.metadata).member("hub", service.hub_name).end_object();
  }
  return json.end_array().str() + "\n";
}

std::string table_of(const std::vector<ServiceRecord>& services, Paint paint) {
  Table table({"NAME", "NODE", "TYPE", "DIRECTION", "DELIVERY", "SUBSCRIBERS", "METADATA"});
  for (const ServiceRecord& service : services) {
    table.add({service.name, service.node.text(),
               std::to_string(service.key.type) + "/" + std::to_string(service.key.instance),
               text_of(service.direction), delivery_of(service), std::to_string(service.subscribers),
               service.metadata});
  }
  return table.text(paint);
}

}  // namespace

ExitCode run_services(Session& session) {
  if (const auto ending = session.join({})) return *ending;
  const auto services = session.node().services(session.options().target);
  if (!services) return session.fail(services.failure());
  session.output().write(session.options().json ? json_of(*services) : table_of(*services, session.paint()));
  if (services->empty() && !session.options().target.empty()) return session.fail_unmatched("service");
  return session.finish();
}

}  // namespace gimnet::tool
