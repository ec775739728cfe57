#include "hub/control/handle/names.hpp"

#include "base/log.hpp"
#include "hub/control/handle/network_page.hpp"
#include "hub/control/state/listing.hpp"
#include "hub/control/state/records.hpp"
#include "hub/control/state/watches.hpp"
#include "proto/control/ns_register.hpp"

namespace gimnet::hub {
namespace {

using proto::Status;
namespace ns = proto::ns;

Result<ns::ListAnswer, proto::Refusal> list(const HandlerContext& context, const Request& request,
                                            const ns::List& wanted) {
  const auto pattern = proto::Pattern::parse(wanted.pattern);
  if (!wanted.pattern.empty() && !pattern) {
    return proto::Refusal{Status::bad_request,
                          "'" + escaped(wanted.pattern, kQuotedMax) +
                              "' is no pattern: write a name of at most 16 parts and 255 bytes in "
                              "which a part may be * or **"};
  }
  NetworkPage<NodeId, ns::NodeRecord> page(context, wanted.after, wanted.records_max);
  const HubTitle title{context.facts.id, context.facts.name};
  page.fill(
      names_for(context, request),
      [](const NameCopies& names, NodeId after) { return names.node_after(after); },
      [&](const KnownName& known) -> std::optional<ns::NodeRecord> {
        if (pattern && !pattern->matches(known.name)) return std::nullopt;
        if (wanted.connected_only && known.standing != ns::NameStanding::held) return std::nullopt;
        if (is_replaced(context, known)) return std::nullopt;
        return node_record_of(known);
      },
      [&](std::uint32_t after) {
        return list_nodes(context.membership,
                          {pattern ? &*pattern : nullptr, NodeIndex{after}, wanted.connected_only,
                           context.limits.page_records, context.limits.scan_records});
      },
      [&](NodeIndex index) {
        const Session& session = *context.membership.sessions().find(index);
        return record_of(title, session, context.membership.services(), context.now);
      });
  return ns::ListAnswer{page.take_records(), page.more(), page.next()};
}

/// The best claim of the whole network to a node's name.
std::optional<KnownName> find_elsewhere(const HandlerContext& context, const Request& request,
                                        std::string_view name) {
  const NameCopies* names = names_for(context, request);
  const auto known = names == nullptr ? std::nullopt : names->find(name);
  return known && known->hub != context.facts.id && !known->claim->service ? known : std::nullopt;
}

Result<ns::ResolveAnswer, proto::Refusal> resolve(const HandlerContext& context,
                                                  const Request& request, const std::string& name) {
  const bool learning = context.names != nullptr && context.names->is_learning(context.now);
  const NameCopies* copies = context.names == nullptr ? nullptr : context.names->copies();
  const bool starved = copies != nullptr && copies->starved();
  if (const auto known = find_elsewhere(context, request, name))
    return ns::ResolveAnswer{known->claim->node, known->standing, learning};
  if (const auto index = context.membership.directory().find(name)) {
    const bool connected = context.membership.sessions().find(*index)->connected;
    return ns::ResolveAnswer{make_id(context.facts.id, *index),
                             connected ? ns::NameStanding::held : ns::NameStanding::away, learning};
  }
  const Topic* topic = context.membership.topics().find(name);
  const auto claim = copies == nullptr ? std::nullopt : copies->find(name);
  if ((topic != nullptr && topic->provided()) || (claim && claim->claim->service)) {
    return proto::Refusal{Status::not_found,
                          "no node has the name '" + escaped(name, kQuotedMax) +
                              "': it is that of a service of the node '" +
                              escaped(name.substr(0, name.rfind('/')), kQuotedMax) + "'",
                          learning};
  }
  return proto::Refusal{Status::not_found,
                        "no node has the name '" + escaped(name, kQuotedMax) +
                            "'; `gimnet nodes` shows those that are there" +
                            (learning ? "; a link came up a moment ago, and names of other hubs "
                                        "may be on their way: try again"
                                      : "") +
                            (starved ? "; this hub has no room for all names of other hubs "
                                       "(names_bytes): ask that node's hub, or use its id"
                                     : ""),
                        learning};
}

Result<ns::ReverseAnswer, proto::Refusal> reverse(const HandlerContext& context, NodeId node) {
  if (const std::optional<NodeIndex> index = own_index(context.facts, node)) {
    if (*index == NodeIndex{kHubIndex})
      return ns::ReverseAnswer{context.facts.name, make_id(context.facts.id, *index)};
    if (const Session* session = context.membership.sessions().find(*index))
      return ns::ReverseAnswer{session->name.str(), make_id(context.facts.id, session->index)};
  } else if (const NameCopies* names =
                 context.names == nullptr ? nullptr : context.names->copies()) {
    if (const auto known = names->find_node(node))
      return ns::ReverseAnswer{std::string{known->name}, node};
  }
  return proto::Refusal{Status::not_found, "no node has that id"};
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

proto::Payload handle_let_go(HandlerContext& context, const Request& request) {
  return answer_to<ns::LetGo>(
      request, [&](const ns::LetGo& wanted) -> Result<ns::LetGoAnswer, proto::Refusal> {
        const Identity identity = wanted.user ? Identity::of_user(*wanted.user) : Identity::open();
        if (context.membership.let_go({wanted.token, wanted.name, identity, context.wall},
                                      context.now, context.effects))
          return ns::LetGoAnswer{};
        return proto::Refusal{Status::not_found,
                              "the token is not honoured at this hub, or the name is another's"};
      });
}

proto::Payload handle_resolve(HandlerContext& context, const Request& request) {
  return answer_to<ns::Resolve>(
      request, [&](const ns::Resolve& wanted) { return resolve(context, request, wanted.name); });
}

proto::Payload handle_reverse(HandlerContext& context, const Request& request) {
  return answer_to<ns::Reverse>(
      request, [&](const ns::Reverse& wanted) { return reverse(context, wanted.node); });
}

proto::Payload handle_list(HandlerContext& context, const Request& request) {
  return answer_to<ns::List>(
      request, [&](const ns::List& wanted) { return list(context, request, wanted); });
}

namespace ns = proto::ns;

proto::Payload handle_watch(HandlerContext& context, const Request& request) {
  return answer_to<ns::Watch>(request, [&](const ns::Watch& wanted) {
    return context.watches.watch(request.session.index, wanted);
  });
}

proto::Payload handle_unwatch(HandlerContext& context, const Request& request) {
  return answer_to<ns::Unwatch>(
      request, [&](const ns::Unwatch& wanted) -> Result<ns::UnwatchAnswer, proto::Refusal> {
        const std::optional<proto::Refusal> failed =
            context.watches.unwatch(request.session.index, wanted.watch);
        if (failed) return *failed;
        return ns::UnwatchAnswer{};
      });
}

proto::Payload handle_watch_taken(HandlerContext& context, const Request& request) {
  return answer_to<ns::WatchTaken>(request, [&](const ns::WatchTaken& taken) {
    context.watches.taken(request.session.index, taken);
    return Result<ns::WatchTakenAnswer, proto::Refusal>(ns::WatchTakenAnswer{});
  });
}

}  // namespace gimnet::hub
