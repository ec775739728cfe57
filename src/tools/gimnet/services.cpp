#include "tools/gimnet/commands.hpp"
#include "tools/gimnet/record_json.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {
namespace {

std::string json_of(const std::vector<ServiceRecord>& services) {
  JsonWriter json;
  json.begin_array();
  for (const ServiceRecord& service : services) write(json, service);
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
  if (const auto ending = session.join_to_look()) return *ending;
  const auto services = session.node().services(session.options().target);
  if (!services) return session.fail(services.failure());
  session.output().write(session.options().json ? json_of(*services) : table_of(*services, session.paint()));
  if (services->empty() && !session.options().target.empty()) return session.fail_unmatched("service");
  return session.finish();
}

}  // namespace gimnet::tool
