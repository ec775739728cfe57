#include "hub/control/handle/admin.hpp"

#include "hub/control/counter_names.hpp"
#include "proto/control/ctrl.hpp"

namespace gimnet::hub {
namespace {

namespace ctrl = proto::ctrl;

ctrl::HubInfoAnswer hub_info(const HandlerContext& context) {
  ctrl::HubInfoAnswer answer;
  answer.hub = context.facts.id;
  answer.hub_name = context.facts.name;
  answer.version = context.facts.version;
  answer.shards = static_cast<std::uint32_t>(context.facts.shards);
  answer.uptime_ms = static_cast<std::uint64_t>((context.now - context.facts.started).count());
  answer.nodes = static_cast<std::uint32_t>(context.membership.sessions().all().size());
  answer.services = static_cast<std::uint32_t>(context.membership.topics().provided());
  return answer;
}

/// Adds the counters that belong to no shard and are not 0.
void add_conductor(const HandlerContext& context, ctrl::StatisticsAnswer& answer) {
  ctrl::ShardRecord record;
  record.shard = ctrl::kConductorRecord;
  const auto add = [&record](const std::string& name, std::uint64_t value) {
    if (value != 0) record.counters.push_back({name, value});
  };
  if (context.refusals != nullptr) for_each_counter(*context.refusals, add);
  if (context.requests != nullptr) for_each_counter(*context.requests, add);
  if (context.network != nullptr) {
    for (const NetworkView::Count& count : context.network->not_taken())
      add(count.name, count.value);
  }
  if (!record.counters.empty()) answer.shards.push_back(std::move(record));
}

ctrl::StatisticsAnswer statistics(const HandlerContext& context) {
  ctrl::StatisticsAnswer answer;
  for (std::size_t i = 0; i < context.counters.size(); ++i) {
    ctrl::ShardRecord& record = answer.shards.emplace_back();
    record.shard = static_cast<std::uint16_t>(i);
    for_each_counter(*context.counters[i], [&record](const std::string& name, std::uint64_t value) {
      record.counters.push_back({name, value});
    });
  }
  add_conductor(context, answer);
  return answer;
}

ctrl::ConnectionCounts counts_of(const SessionCounts& counts) {
  return {counts.queued_bytes,
          counts.accepted,
          counts.received_bytes,
          counts.delivered,
          counts.sent_bytes,
          counts.dropped,
          0,
          counts.queue_full};
}

ctrl::ConnectionsAnswer connections(const HandlerContext& context,
                                    const ctrl::Connections& wanted) {
  ctrl::ConnectionsAnswer answer;
  PageBudget budget(context.limits, wanted.records_max);
  const auto& all = context.membership.sessions().all();
  for (auto entry = all.upper_bound(node_index_of(wanted.after)); entry != all.end(); ++entry) {
    const Session& session = entry->second;
    ctrl::ConnectionRecord record;
    record.node = make_id(context.facts.id, session.index);
    record.name = session.name.str();
    record.shard = session.place.shard.value();
    record.transport = session.origin.transport.str();
    record.peer = session.origin.address.str();
    record.connected = session.connected;
    const std::size_t shard = session.place.shard.value();
    if (shard < context.sessions.size()) {
      record.counts =
          counts_of(context.sessions[shard]->counts(session.place.slot, session.place.generation));
    }
    record.counts.missed = context.membership.services().missed_by(session.index);
    if (!budget.take(ctrl::page_bytes_max(record))) {
      answer.more = true;
      break;
    }
    answer.connections.push_back(std::move(record));
  }
  return answer;
}

}  // namespace

proto::Payload handle_hub_info(HandlerContext& context, const Request& request) {
  return answer_to<ctrl::HubInfo>(request, [&context](const ctrl::HubInfo&) {
    return Result<ctrl::HubInfoAnswer, proto::Refusal>(hub_info(context));
  });
}

proto::Payload handle_statistics(HandlerContext& context, const Request& request) {
  return answer_to<ctrl::Statistics>(request, [&context](const ctrl::Statistics&) {
    return Result<ctrl::StatisticsAnswer, proto::Refusal>(statistics(context));
  });
}

proto::Payload handle_connections(HandlerContext& context, const Request& request) {
  return answer_to<ctrl::Connections>(request, [&context](const ctrl::Connections& wanted) {
    return Result<ctrl::ConnectionsAnswer, proto::Refusal>(connections(context, wanted));
  });
}

}  // namespace gimnet::hub
