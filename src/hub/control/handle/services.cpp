#include "hub/control/handle/services.hpp"

#include <algorithm>
#include <cmath>

#include "base/log.hpp"
#include "hub/control/handle/network_page.hpp"
#include "hub/control/state/listing.hpp"
#include "hub/control/state/records.hpp"
#include "proto/control/names.hpp"
#include "proto/control/ns.hpp"

namespace gimnet::hub {
namespace {

using proto::Status;
namespace ns = proto::ns;

GroupId group_id(const HandlerContext& context, GroupIndex index) {
  return make_id(context.facts.id, index);
}

proto::Refusal out_of_range(std::string_view what, const std::string& range,
                            std::string_view limit) {
  return proto::Refusal{Status::bad_request, std::string{what} + " must be " + range +
                                                 "; the hub's --limit " + std::string{limit} +
                                                 " bounds it"};
}

/// Checks the delivery that a service wants. A limit that was lowered meanwhile holds for new
/// services only: a service keeps the n that `standing` has, or it would be gone when its node
/// comes back and repeats it.
std::optional<proto::Refusal> fault_of(const Limits& limits, const ns::Advertise& offer,
                                       const ServiceTerms* standing) {
  const bool counted = offer.delivery == ns::Delivery::sync;
  if (offer.direction == ns::Direction::accepts && (counted || offer.retain)) {
    return proto::Refusal{
        Status::bad_request,
        "a service that accepts data has no subscribers: leave out delivery sync(n) and retain"};
  }
  if (!counted && offer.window != 0) {
    return proto::Refusal{Status::bad_request,
                          "a window belongs to delivery sync(n): leave one of them out"};
  }
  const bool stands = standing != nullptr && standing->window == offer.window;
  if (counted && offer.window > limits.sync_window && !stands) {
    return out_of_range("n of delivery sync(n)", "1 to " + std::to_string(limits.sync_window),
                        "sync_window");
  }
  return std::nullopt;
}

/// The same of a subscription, as for fault_of().
Result<SubscriberTerms, proto::Refusal> terms_of(const Limits& limits, const ns::Subscribe& wanted,
                                                 const std::optional<SubscriberTerms>& standing) {
  constexpr double kRateMin = 0.001;
  SubscriberTerms terms;
  terms.window = wanted.window;
  terms.depth = wanted.depth;
  terms.number = wanted.number;
  if (wanted.window > limits.sync_window && !(standing && standing->window == terms.window)) {
    return out_of_range("the window of a subscription",
                        "1 to " + std::to_string(limits.sync_window), "sync_window");
  }
  if (wanted.depth < 1 ||
      (wanted.depth > limits.subscription_depth && !(standing && standing->depth == terms.depth))) {
    return out_of_range("the depth of a subscription",
                        "1 to " + std::to_string(limits.subscription_depth), "subscription_depth");
  }
  if (wanted.rate_hz == 0.0) return terms;
  const auto rate_max = static_cast<double>(limits.subscription_rate_hz);
  // Not a number is neither.
  const bool has_interval = wanted.rate_hz >= kRateMin;
  if (has_interval) terms.interval_us = static_cast<std::uint32_t>(std::ceil(1e6 / wanted.rate_hz));
  const bool stands =
      standing && terms.interval_us != 0 && standing->interval_us == terms.interval_us;
  if (!has_interval || (wanted.rate_hz > rate_max && !stands)) {
    return out_of_range("the maximal rate of a subscription",
                        "0.001 to " + std::to_string(limits.subscription_rate_hz) + " Hz",
                        "subscription_rate_hz");
  }
  return terms;
}

Result<ns::AdvertiseAnswer, proto::Refusal> advertise(HandlerContext& context,
                                                      const Session& session,
                                                      const ns::Advertise& offer) {
  if (session.name.empty()) {
    return proto::Refusal{
        Status::bad_request,
        "a node without a name cannot advertise: services are named after their node"};
  }
  if (!proto::valid_service_name(offer.service)) {
    return proto::Refusal{Status::bad_request,
                          "'" + escaped(offer.service, kQuotedMax) +
                              "' is no name of a service: one part of A-Z a-z 0-9 . _ -"};
  }
  const std::string full_name = proto::join_service_name(session.name, offer.service);
  const ServiceTerms* const standing =
      context.membership.services().provided(session.index, full_name);
  if (auto refusal = fault_of(context.limits, offer, standing)) return *refusal;
  if (standing == nullptr) {
    if (auto refusal = context.membership.directory().service_refusal(full_name)) return *refusal;
  }
  ServiceTerms terms;
  terms.message_type = offer.message_type;
  terms.instance = offer.instance;
  terms.direction = offer.direction;
  terms.delivery = offer.delivery;
  terms.metadata = offer.metadata;
  terms.window = offer.delivery == ns::Delivery::sync ? std::max(1u, offer.window) : 0;
  terms.retain = offer.retain;
  if (standing == nullptr || *standing != terms) {
    if (auto refusal = count_declaration(context, session)) return *refusal;
  }
  const auto done = context.membership.services().advertise(session.index, full_name, terms,
                                                            context.now, context.effects);
  if (!done) return done.error();
  return ns::AdvertiseAnswer{group_id(context, done->group), done->subscribers};
}

/// The messages that the subscribers at this hub missed.
void put_missed(ns::ServiceRecord& record, HubId hub, const Topic& topic) {
  std::uint64_t most = 0;
  for (const auto& [subscriber, missed] : topic.missed) {
    record.missed += missed;
    if (missed <= most) continue;
    most = missed;
    record.missed_most = make_id(hub, subscriber);
  }
}

Result<ns::ServicesAnswer, proto::Refusal> services(const HandlerContext& context,
                                                    const Request& request,
                                                    const ns::ServicesRequest& wanted) {
  const auto pattern = proto::Pattern::parse(wanted.pattern);
  if (!wanted.pattern.empty() && !pattern) {
    return proto::Refusal{Status::bad_request,
                          "'" + escaped(wanted.pattern, kQuotedMax) +
                              "' is no pattern: write a full name of at most 16 parts and 255 "
                              "bytes in which a part may be * or **"};
  }
  NetworkPage<GroupId, ns::ServiceRecord> page(context, wanted.after, wanted.records_max);
  const Topics& own = context.membership.topics();
  const HubTitle title{context.facts.id, context.facts.name};
  // From afar a hub tells of services of other hubs only what no other hub can tell.
  const bool others = wanted.missed && context.names != nullptr;
  page.fill(
      others ? context.names->copies() : names_for(context, request),
      [](const NameCopies& names, GroupId after) { return names.group_after(after); },
      [&](const KnownName& known) -> std::optional<ns::ServiceRecord> {
        if (pattern && !pattern->matches(known.name)) return std::nullopt;
        if (is_replaced(context, known)) return std::nullopt;
        ns::ServiceRecord record = service_record_of(known);
        const Topic* topic = own.find(record.name);
        if (wanted.missed && (topic == nullptr || topic->missed.empty())) return std::nullopt;
        if (topic != nullptr) {
          record.subscribers = topic->subscriber_count();
          put_missed(record, title.id, *topic);
        }
        return record;
      },
      [&](std::uint32_t after) {
        return list_services(own, {pattern ? &*pattern : nullptr, GroupIndex{after}, false,
                                   context.limits.page_records, context.limits.scan_records});
      },
      [&](GroupIndex index) {
        ns::ServiceRecord record = record_of(title, *own.find_group(index));
        put_missed(record, title.id, *own.find_group(index));
        return record;
      });
  return ns::ServicesAnswer{page.take_records(), page.more(), page.next()};
}

}  // namespace

proto::Payload handle_advertise(HandlerContext& context, const Request& request) {
  return answer_to<ns::Advertise>(request, [&](const ns::Advertise& offer) {
    return advertise(context, request.session, offer);
  });
}

proto::Payload handle_withdraw(HandlerContext& context, const Request& request) {
  return answer_to<ns::Withdraw>(
      request, [&](const ns::Withdraw& wanted) -> Result<ns::WithdrawAnswer, proto::Refusal> {
        const std::optional<GroupIndex> group = own_index(context.facts, wanted.group);
        if (!group) return proto::Refusal{Status::not_found, "that group belongs to another hub"};
        const std::optional<proto::Refusal> failed = context.membership.services().withdraw(
            request.session.index, *group, context.now, context.effects);
        if (failed) return *failed;
        return ns::WithdrawAnswer{};
      });
}

proto::Payload handle_services(HandlerContext& context, const Request& request) {
  return answer_to<ns::ServicesRequest>(request, [&](const ns::ServicesRequest& wanted) {
    return services(context, request, wanted);
  });
}

proto::Payload handle_subscribe(HandlerContext& context, const Request& request) {
  return answer_to<ns::Subscribe>(
      request, [&](const ns::Subscribe& wanted) -> Result<ns::SubscribeAnswer, proto::Refusal> {
        const auto standing =
            context.membership.services().subscribed(request.session.index, wanted.name);
        const auto terms = terms_of(context.limits, wanted, standing);
        if (!terms) return terms.error();
        SubscriberTerms repeated = standing.value_or(SubscriberTerms{});
        repeated.number = terms->number;
        if (!standing || repeated != *terms) {
          if (auto refusal = count_declaration(context, request.session)) return *refusal;
        }
        // A window where there was none begins new counts, under whatever number.
        const Topic* const known = context.membership.topics().find(wanted.name);
        const bool counted =
            standing && known != nullptr && known->window_of(request.session.index) != 0;
        const NameCopies* names = names_for(context, request);
        const auto away =
            names != nullptr ? context.names->away_service(wanted.name) : std::nullopt;
        const auto topic = context.membership.services().subscribe(
            request.session.index, wanted.name, *terms, context.effects, away);
        if (!topic) return topic.error();
        if ((*topic)->away) context.joins = (*topic)->away->group;
        ns::SubscribeAnswer answer;
        put_state(answer, HubTitle{context.facts.id, context.facts.name}, **topic,
                  context.membership, names);
        answer.window = (*topic)->window_of(request.session.index);
        answer.number = terms->number;
        if (answer.window != 0 && (!counted || standing->number != terms->number))
          context.counts = CountsBegin{answer.group, terms->number};
        return answer;
      });
}

proto::Payload handle_unsubscribe(HandlerContext& context, const Request& request) {
  return answer_to<ns::Unsubscribe>(
      request, [&](const ns::Unsubscribe& wanted) -> Result<ns::UnsubscribeAnswer, proto::Refusal> {
        const std::optional<proto::Refusal> failed = context.membership.services().unsubscribe(
            request.session.index, wanted.name, context.now, context.effects);
        if (failed) return *failed;
        return ns::UnsubscribeAnswer{};
      });
}

}  // namespace gimnet::hub
