#include "hub/control/dispatch.hpp"

#include <algorithm>
#include <array>

#include "hub/control/handle/admin.hpp"
#include "hub/control/handle/administer.hpp"
#include "hub/control/handle/names.hpp"
#include "hub/control/handle/network.hpp"
#include "hub/control/handle/services.hpp"
#include "proto/control/ctrl_network.hpp"
#include "proto/control/ns_register.hpp"
#include "proto/control/ns_watch.hpp"

namespace gimnet::hub {
namespace {

using proto::Kind;
using proto::Role;
namespace ns = proto::ns;
namespace ctrl = proto::ctrl;

enum Roles : std::uint8_t { nodes = 1, admins = 2, everybody = nodes | admins };

struct TableRow {
  Kind kind;
  std::uint16_t operation;
  Roles roles;
  Handler handler;
};

constexpr std::array kTable{
    TableRow{Kind::ns, ns::RegisterName::kOperation, everybody, handle_register},
    TableRow{Kind::ns, ns::UnregisterName::kOperation, everybody, handle_unregister},
    TableRow{Kind::ns, ns::Resolve::kOperation, everybody, handle_resolve},
    TableRow{Kind::ns, ns::Reverse::kOperation, everybody, handle_reverse},
    TableRow{Kind::ns, ns::List::kOperation, everybody, handle_list},
    TableRow{Kind::ns, ns::Advertise::kOperation, everybody, handle_advertise},
    TableRow{Kind::ns, ns::Withdraw::kOperation, everybody, handle_withdraw},
    TableRow{Kind::ns, ns::ServicesRequest::kOperation, everybody, handle_services},
    TableRow{Kind::ns, ns::Subscribe::kOperation, everybody, handle_subscribe},
    TableRow{Kind::ns, ns::Unsubscribe::kOperation, everybody, handle_unsubscribe},
    TableRow{Kind::ns, ns::Watch::kOperation, everybody, handle_watch},
    TableRow{Kind::ns, ns::Unwatch::kOperation, everybody, handle_unwatch},
    TableRow{Kind::ns, ns::WatchTaken::kOperation, everybody, handle_watch_taken},
    TableRow{Kind::ctrl, ctrl::HubInfo::kOperation, everybody, handle_hub_info},
    TableRow{Kind::ctrl, ctrl::Statistics::kOperation, everybody, handle_statistics},
    TableRow{Kind::ctrl, ctrl::Connections::kOperation, everybody, handle_connections},
    TableRow{Kind::ctrl, ctrl::Hubs::kOperation, everybody, handle_hubs},
    TableRow{Kind::ctrl, ctrl::LinksRequest::kOperation, everybody, handle_links},
    TableRow{Kind::ctrl, ctrl::Kick::kOperation, admins, handle_kick},
    TableRow{Kind::ctrl, ctrl::Reassign::kOperation, admins, handle_reassign},
    TableRow{Kind::ctrl, ctrl::Drain::kOperation, admins, handle_drain},
    TableRow{Kind::ctrl, ctrl::Reload::kOperation, admins, handle_reload},
    TableRow{Kind::ctrl, ctrl::SetLogLevel::kOperation, admins, handle_log_level},
    TableRow{Kind::ctrl, ctrl::LinkAdd::kOperation, admins, handle_link_add},
    TableRow{Kind::ctrl, ctrl::LinkRemove::kOperation, admins, handle_link_remove},
    TableRow{Kind::ctrl, ctrl::SetLinkCost::kOperation, admins, handle_link_cost},
};

Roles mask_of(Role role) { return role == Role::admin ? admins : nodes; }

proto::Payload handle_unknown(HandlerContext&, const Request& request) {
  return proto::encode_refusal(
      request.header, {proto::Status::not_supported,
                       "this hub has no operation " + std::to_string(request.header.operation)});
}

proto::Payload handle_denied_from_afar(HandlerContext&, const Request& request) {
  return proto::encode_refusal(
      request.header, {proto::Status::denied,
                       "from another hub this can be asked for when identities travel; connect to "
                       "the hub itself"});
}

}  // namespace

Handler handler_for(Role role, Kind kind, std::uint16_t operation) {
  for (const TableRow& entry : kTable) {
    if (entry.kind != kind || entry.operation != operation) continue;
    return (entry.roles & mask_of(role)) != 0 ? entry.handler : handle_denied;
  }
  return handle_unknown;
}

Handler handler_from_afar(NodeId asker, Kind kind, std::uint16_t operation) {
  constexpr std::array kNames{ns::Resolve::kOperation, ns::Reverse::kOperation,
                              ns::List::kOperation, ns::ServicesRequest::kOperation};
  constexpr std::array kAdmin{ctrl::HubInfo::kOperation, ctrl::Statistics::kOperation,
                              ctrl::Connections::kOperation, ctrl::Hubs::kOperation,
                              ctrl::LinksRequest::kOperation};
  const auto has = [operation](const auto& all) {
    return std::ranges::find(all, operation) != all.end();
  };
  const bool is_hub = index_of(asker) == kHubIndex;
  if (is_hub && kind == Kind::ns && operation == ns::LetGo::kOperation) return handle_let_go;
  const bool reads = kind == Kind::ns ? has(kNames) : has(kAdmin);
  return reads ? handler_for(Role::node, kind, operation) : handle_denied_from_afar;
}

proto::Payload handle_for_another(HandlerContext& context, const Request& request) {
  return proto::encode_refusal(
      request.header,
      {proto::Status::not_found, "no hub answers at that address: there is no route from hub " +
                                     std::to_string(context.facts.id.value()) +
                                     " to it; ask the own hub with dst 0"});
}

}  // namespace gimnet::hub
