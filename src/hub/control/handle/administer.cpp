#include "hub/control/handle/administer.hpp"

#include "base/ids.hpp"
#include "base/suggest.hpp"
#include "proto/control/ctrl.hpp"
#include "proto/control/fields.hpp"

namespace gimnet::hub {
namespace {

namespace ctrl = proto::ctrl;
using proto::Refusal;
using proto::Status;

/// The session of a node of this hub, also by an id that it had before; or why there is none.
Result<Session*, Refusal> find_node(const HandlerContext& context, NodeId node) {
  Sessions& sessions = context.membership.sessions();
  const std::optional<NodeIndex> index = own_index(context.facts, node);
  Session* session = index ? sessions.find(sessions.present_index(*index)) : nullptr;
  if (session != nullptr) return session;
  return Refusal{Status::not_found, "there is no node " + to_string(node) +
                                        " on this hub; `gimnet nodes` lists those that are there"};
}

std::string by_whom(const Session& admin) {
  return admin.origin.transport.str() + " " + admin.origin.address.str();
}

Membership::KeepNow keep_now(const HandlerContext& context) {
  if (context.administration == nullptr) return {};
  return [administration = context.administration, now = context.now] {
    return administration->keep_state(now);
  };
}

Result<ctrl::KickAnswer, Refusal> kick(HandlerContext& context, const Request& request,
                                       const ctrl::Kick& wanted) {
  const auto session = find_node(context, wanted.node);
  if (!session) return session.error();
  if (*session == &request.session) {
    return Refusal{Status::bad_request, "that is you: say GOODBYE to leave, or name another node"};
  }
  const std::string who = title(context.membership.sessions().node_id(**session), **session);
  const std::string why = wanted.reason.empty() ? "" : ": " + wanted.reason;
  log_warning(who + " was kicked by " + by_whom(request.session) + why);
  const std::string failure = context.membership.kick(
      **session, "an administrator ended this session" + why + "; ask them before you come back",
      context.now, context.effects, keep_now(context));
  if (failure.empty()) return ctrl::KickAnswer{};
  return ctrl::KickAnswer{"if the hub ends now it forgets that it kicked " + who +
                          ", which then may come back: " + failure};
}

Result<ctrl::ReassignAnswer, Refusal> reassign(HandlerContext& context, const Request& request,
                                               const ctrl::Reassign& wanted) {
  const auto session = find_node(context, wanted.node);
  if (!session) return session.error();
  const std::optional<NodeIndex> index = own_index(context.facts, wanted.new_node);
  if (!index) {
    return Refusal{Status::bad_request, "the id " + to_string(wanted.new_node) +
                                            " is not one of this hub's, which begin with " +
                                            std::to_string(context.facts.id.value()) + "."};
  }
  if (*session == &request.session) {
    return Refusal{Status::bad_request,
                   "that is you: an administrator's own id cannot change while it asks"};
  }
  const std::string who = title(context.membership.sessions().node_id(**session), **session);
  if (auto failure = context.membership.renumber(**session, *index, context.now, context.effects,
                                                 keep_now(context))) {
    return *failure;
  }
  log_warning(who + " has the id " + to_string(context.membership.sessions().node_id(**session)) +
              " now, by " + by_whom(request.session));
  return ctrl::ReassignAnswer{};
}

Result<ctrl::DrainAnswer, Refusal> drain(HandlerContext& context, const Request& request) {
  if (context.administration == nullptr)
    return Refusal{Status::not_supported, "this hub cannot be drained"};
  log_warning("draining, asked for by " + by_whom(request.session));
  context.administration->want_drain();
  return ctrl::DrainAnswer{};
}

Result<ctrl::ReloadAnswer, Refusal> reload(HandlerContext& context) {
  if (context.administration == nullptr) {
    return Refusal{Status::not_supported,
                   "this hub has no configuration that could be read again; start it anew"};
  }
  const Reloading reloading = context.administration->reload();
  if (!reloading.faults.empty()) {
    return Refusal{Status::bad_request, reload_refusal(reloading, proto::kSentenceBytesMax)};
  }
  ctrl::ReloadAnswer answer;
  PageBudget budget(context.limits, ctrl::kPageRecordsDefault);
  for (const Reloading::Change& change : reloading.changes) {
    ctrl::ChangeRecord record{change.key, change.from, change.to, change.needs_restart};
    if (!budget.take(ctrl::page_bytes_max(record))) {
      answer.more = true;
      break;
    }
    answer.changes.push_back(std::move(record));
  }
  return answer;
}

Result<ctrl::SetLogLevelAnswer, Refusal> set_level(HandlerContext& context,
                                                   const ctrl::SetLogLevel& wanted) {
  LogLevel level{};
  if (!parse_log_level(wanted.level, level)) {
    return Refusal{Status::bad_request, "there is no log level '" +
                                            escaped(wanted.level, kQuotedMax) +
                                            "': error, warning, info, debug or off" +
                                            did_you_mean(wanted.level, kLogLevelNames)};
  }
  ctrl::SetLogLevelAnswer answer{std::string{log_level_name(log_level())}};
  set_log_level(level);
  if (context.administration != nullptr) context.administration->log_level_set(level);
  return answer;
}

}  // namespace

proto::Payload handle_kick(HandlerContext& context, const Request& request) {
  return answer_to<ctrl::Kick>(
      request, [&](const ctrl::Kick& wanted) { return kick(context, request, wanted); });
}

proto::Payload handle_reassign(HandlerContext& context, const Request& request) {
  return answer_to<ctrl::Reassign>(
      request, [&](const ctrl::Reassign& wanted) { return reassign(context, request, wanted); });
}

proto::Payload handle_drain(HandlerContext& context, const Request& request) {
  return answer_to<ctrl::Drain>(request,
                                [&](const ctrl::Drain&) { return drain(context, request); });
}

proto::Payload handle_reload(HandlerContext& context, const Request& request) {
  return answer_to<ctrl::Reload>(request, [&](const ctrl::Reload&) { return reload(context); });
}

proto::Payload handle_log_level(HandlerContext& context, const Request& request) {
  return answer_to<ctrl::SetLogLevel>(
      request, [&](const ctrl::SetLogLevel& wanted) { return set_level(context, wanted); });
}

proto::Payload handle_denied(HandlerContext&, const Request& request) {
  return proto::encode_refusal(
      request.header,
      {Status::denied,
       "only administrators change a hub: connect with the role admin over its Unix socket, as "
       "root or as the user that runs it"});
}

}  // namespace gimnet::hub
