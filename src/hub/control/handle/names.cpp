#include "hub/control/handle/names.hpp"

#include "base/log.hpp"
#include "hub/control/state/listing.hpp"
#include "hub/control/state/records.hpp"
#include "proto/control/ns_register.hpp"

namespace gimnet::hub {
namespace {

using proto::Status;
namespace ns = proto::ns;

Result<ns::ListAnswer, proto::Refusal> list(const HandlerContext& context, const ns::List& wanted) {
  const auto pattern = proto::Pattern::parse(wanted.pattern);
  if (!wanted.pattern.empty() && !pattern) {
    return proto::Refusal{Status::bad_request,
                          "'" + escaped(wanted.pattern, kQuotedMax) +
                              "' is no pattern: write a name of at most 16 parts and 255 bytes in "
                              "which a part may be * or **"};
  }
  const Listed<NodeIndex> listed =
      list_nodes(context.membership,
                 {pattern ? &*pattern : nullptr, node_index_of(wanted.after), wanted.connected_only,
                  context.limits.page_records, context.limits.scan_records});
  ns::ListAnswer answer;
  answer.more = listed.more;
  answer.next = listed.more ? make_id(context.facts.id, listed.next) : NodeId{};
  PageBudget budget(context.limits, wanted.records_max);
  const HubTitle title{context.facts.id, context.facts.name};
  for (const NodeIndex index : listed.indices) {
    const Session& session = *context.membership.sessions().find(index);
    ns::NodeRecord record = record_of(title, session, context.membership.services(), context.now);
    if (!budget.take(ns::page_bytes_max(record))) {
      answer.more = true;
      answer.next = answer.nodes.empty() ? wanted.after : answer.nodes.back().node;
      break;
    }
    answer.nodes.push_back(std::move(record));
  }
  return answer;
}

}  // namespace

proto::Payload handle_register(HandlerContext& context, const Request& request) {
  return answer_to<ns::RegisterName>(
      request,
      [&](const ns::RegisterName& wanted) -> Result<ns::RegisterNameAnswer, proto::Refusal> {
        if (wanted.name.empty())
          return proto::Refusal{Status::bad_request, "REGISTER needs a name"};
        Session& session = *context.membership.sessions().find(request.session.index);
        if (wanted.name != session.name) {
          if (auto refusal = count_declaration(context, session)) return *refusal;
        }
        const auto failed =
            context.membership.rename(session, wanted.name, context.now, context.effects);
        if (failed) return *failed;
        return ns::RegisterNameAnswer{session.name.str(),
                                      context.membership.directory().is_provisional(session.name),
                                      context.membership.sessions().token_of(session)};
      });
}

proto::Payload handle_unregister(HandlerContext& context, const Request& request) {
  return answer_to<ns::UnregisterName>(
      request, [&](const ns::UnregisterName&) -> Result<ns::UnregisterNameAnswer, proto::Refusal> {
        if (request.session.name.empty())
          return proto::Refusal{Status::not_found, "this node has no name"};
        Session& session = *context.membership.sessions().find(request.session.index);
        if (auto refusal = count_declaration(context, session)) return *refusal;
        const auto failed = context.membership.rename(session, "", context.now, context.effects);
        if (failed) return *failed;
        return ns::UnregisterNameAnswer{context.membership.sessions().token_of(session)};
      });
}

proto::Payload handle_resolve(HandlerContext& context, const Request& request) {
  return answer_to<ns::Resolve>(
      request, [&context](const ns::Resolve& wanted) -> Result<ns::ResolveAnswer, proto::Refusal> {
        const std::optional<NodeIndex> index = context.membership.directory().find(wanted.name);
        if (!index) {
          return proto::Refusal{Status::not_found,
                                "no node has the name '" + escaped(wanted.name, kQuotedMax) +
                                    "'; `gimnet nodes` shows those that are there"};
        }
        return ns::ResolveAnswer{make_id(context.facts.id, *index)};
      });
}

proto::Payload handle_reverse(HandlerContext& context, const Request& request) {
  return answer_to<ns::Reverse>(
      request, [&context](const ns::Reverse& wanted) -> Result<ns::ReverseAnswer, proto::Refusal> {
        const std::optional<NodeIndex> index = own_index(context.facts, wanted.node);
        if (index == NodeIndex{kHubIndex})
          return ns::ReverseAnswer{context.facts.name, make_id(context.facts.id, *index)};
        const Session* session = index ? context.membership.sessions().find(*index) : nullptr;
        if (session == nullptr) return proto::Refusal{Status::not_found, "no node has that id"};
        return ns::ReverseAnswer{session->name.str(), make_id(context.facts.id, session->index)};
      });
}

proto::Payload handle_list(HandlerContext& context, const Request& request) {
  return answer_to<ns::List>(request,
                             [&context](const ns::List& wanted) { return list(context, wanted); });
}

}  // namespace gimnet::hub
