#include "hub/control/change_log.hpp"

#include <string>

#include "base/id_text.hpp"
#include "base/log.hpp"

namespace gimnet::hub {
namespace {

using proto::ns::ChangeKind;

const char* happening(ChangeKind kind) {
  switch (kind) {
    case ChangeKind::joined:
      return "has joined";
    case ChangeKind::left:
      return "has left for good: its id and name are free";
    case ChangeKind::away:
      return "is away: its grace time runs";
    case ChangeKind::back:
      return "is back";
    case ChangeKind::renamed:
      return "has another name";
    case ChangeKind::advertised:
      return "is there";
    case ChangeKind::withdrawn:
      return "was withdrawn";
    case ChangeKind::begin:
    case ChangeKind::present:
    case ChangeKind::end:
    case ChangeKind::changed:
      break;
  }
  return "has changed";
}

std::string node_text(HubId hub, NodeIndex index, const std::string& name) {
  const std::string id = "node " + to_string(make_id(hub, index));
  return name.empty() ? id : id + " '" + name + "'";
}

/// Limited by rate: a node that comes and goes again and again keeps no others out of the log.
void say(const char* what, const std::string& about, const std::string& more = {}) {
  log_line(LogLevel::debug, {what, about}, about + " " + what + more);
}

}  // namespace

void log_change(const NodeNoted& noted, const Membership& membership, HubId hub) {
  if (!log_enabled(LogLevel::debug)) return;
  const Session* session =
      noted.kind == ChangeKind::left ? nullptr : membership.sessions().find(noted.index);
  const std::string name = session != nullptr ? session->name.str() : noted.name;
  const std::string before =
      noted.kind == ChangeKind::renamed ? ", before '" + noted.former_name + "'" : "";
  say(happening(noted.kind), node_text(hub, noted.index, name), before);
}

void log_change(const ServiceNoted& noted, const Membership& membership, HubId hub) {
  if (!log_enabled(LogLevel::debug)) return;
  const Topic* topic =
      noted.kind == ChangeKind::withdrawn ? nullptr : membership.topics().find_group(noted.group);
  const std::string name = topic != nullptr ? std::string{topic->full_name} : noted.full_name;
  say(happening(noted.kind), "service " + to_string(make_id(hub, noted.group)) + " '" + name + "'",
      ", of " + node_text(hub, noted.provider, {}));
}

void log_change(const RenumberDue& due, const Membership& membership, HubId hub) {
  if (!log_enabled(LogLevel::debug)) return;
  const Session* session = membership.sessions().find(due.index);
  say("has another id",
      node_text(hub, due.former, session != nullptr ? session->name.str() : std::string{}),
      ", " + to_string(make_id(hub, due.index)));
}

}  // namespace gimnet::hub
