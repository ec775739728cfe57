#include "hub/control/handle/names.hpp"

#include "base/log.hpp"
#include "proto/control/names.hpp"
#include "proto/control/ns.hpp"

namespace gimnet::hub {
namespace {

using proto::Status;
namespace ns = proto::ns;

constexpr std::size_t kQuotedMax = 60;

ns::NodeRecord record_of(const HandlerContext& context, const Session& session) {
  ns::NodeRecord record;
  record.node = make_id<NodeId>(context.facts.id, session.index);
  record.name = session.name;
  record.hub = context.facts.id;
  record.hub_name = context.facts.name;
  record.connected = session.connected;
  record.description = session.description;
  record.place = session.origin.address;
  record.joined_ms = static_cast<std::uint64_t>((context.now - session.joined).count());
  record.services = static_cast<std::uint32_t>(context.membership.services().services_of(session.index));
  return record;
}

Result<ns::ListAnswer, proto::Refusal> list(const HandlerContext& context, const ns::List& wanted) {
  if (!wanted.pattern.empty() && !proto::valid_pattern(wanted.pattern)) {
    return proto::Refusal{Status::bad_request, "'" + escaped(wanted.pattern, kQuotedMax) +
                                                   "' is no pattern: write a name in which a part may be * or **"};
  }
  ns::ListAnswer answer;
  PageBudget budget(context.limits, wanted.records_max);
  const auto& all = context.membership.sessions().all();
  for (auto entry = all.upper_bound(index_of(wanted.after)); entry != all.end(); ++entry) {
    const Session& session = entry->second;
    if (!wanted.pattern.empty() && !proto::matches(wanted.pattern, session.name)) continue;
    ns::NodeRecord record = record_of(context, session);
    if (!budget.take(ns::page_bytes_max(record))) {
      answer.more = true;
      break;
    }
    answer.nodes.push_back(std::move(record));
  }
  return answer;
}

}  // namespace

proto::Payload handle_resolve(HandlerContext& context, const Request& request) {
  return answer_to<ns::Resolve>(
      request, [&context](const ns::Resolve& wanted) -> Result<ns::ResolveAnswer, proto::Refusal> {
        const std::optional<std::uint32_t> index = context.membership.directory().find(wanted.name);
        if (!index) {
          return proto::Refusal{Status::not_found, "no node has the name '" + escaped(wanted.name, kQuotedMax) +
                                                       "'; `gimnet nodes` shows those that are there"};
        }
        return ns::ResolveAnswer{make_id<NodeId>(context.facts.id, *index)};
      });
}

proto::Payload handle_reverse(HandlerContext& context, const Request& request) {
  return answer_to<ns::Reverse>(
      request, [&context](const ns::Reverse& wanted) -> Result<ns::ReverseAnswer, proto::Refusal> {
        const std::optional<std::uint32_t> index = own_index(context.facts, wanted.node);
        if (index == kHubIndex) return ns::ReverseAnswer{context.facts.name, make_id<NodeId>(context.facts.id, 0)};
        const Session* session = index ? context.membership.sessions().find(*index) : nullptr;
        if (session == nullptr) return proto::Refusal{Status::not_found, "no node has that id"};
        return ns::ReverseAnswer{session->name, make_id<NodeId>(context.facts.id, session->index)};
      });
}

proto::Payload handle_list(HandlerContext& context, const Request& request) {
  return answer_to<ns::List>(request, [&context](const ns::List& wanted) { return list(context, wanted); });
}

}  // namespace gimnet::hub
