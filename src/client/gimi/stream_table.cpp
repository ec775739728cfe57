#include "client/gimi/stream_table.hpp"

#include <utility>

#include "client/gimi/loss_tally.hpp"
#include "proto/frame/report.hpp"

namespace gimnet::gimi {
namespace {

/// The grace time of a hub, if nobody changed it.
constexpr std::int64_t kGraceNs = 30'000'000'000;

/// After these nothing arrives there any more, and no ACK comes back.
bool is_route_gone(std::uint32_t reason) {
  switch (static_cast<proto::DropReason>(reason)) {
    case proto::DropReason::no_such_node:
    case proto::DropReason::no_such_group:
    case proto::DropReason::no_route:
    case proto::DropReason::away:
    case proto::DropReason::link_lost:
    case proto::DropReason::renumbered:
      return true;
    default:
      return false;
  }
}

}  // namespace

std::optional<Failure> conflict(const SendStream& standing, const SendOptions& options) {
  SendOptions wanted = options;
  // The service says its key.
  if (!standing.service().empty()) wanted.key = standing.options().key;
  // Each Sender has a wish of its own.
  wanted.wait_if_away = standing.options().wait_if_away;
  if (wanted == standing.options()) return std::nullopt;
  const bool to_service = !standing.service().empty();
  return Failure{Status::bad_argument,
                 "cannot send to " + (to_service ? standing.service() : standing.to().text()) +
                     " with these options: this node sends there with others" +
                     (to_service ? "" : ", with the same key") +
                     "; they hold as long as it lives, so take the same ones" +
                     (to_service ? "" : " or another key")};
}

std::optional<Failure> StreamTable::obstacle(const SendOptions& options) const {
  if (options.window > kWindowMax) {
    return Failure{Status::bad_argument,
                   "a window of " + std::to_string(options.window) +
                       " messages is more than one ACK can speak of: at most " +
                       std::to_string(kWindowMax)};
  }
  if (streams_.size() + services_.size() < kStreamsMax) return std::nullopt;
  return Failure{Status::limit, "this node sends to " + std::to_string(kStreamsMax) +
                                    " (peer, key) and services already"};
}

Outcome<StreamTable::Stream> StreamTable::stream(Peer to, const SendOptions& options) {
  if (!to) return Failure{Status::bad_argument, "cannot send to nobody: the peer's id is 0"};
  if (is_every_node(to)) {
    return Failure{Status::bad_argument,
                   "cannot send to " + to.text() + ": this id means all nodes; send to one node"};
  }
  const MutexLock lock(mutex_);
  const StreamName name{to, options.key, 0};
  const auto place = streams_.find(name);
  if (place != streams_.end()) {
    if (auto failure = conflict(*place->second, options)) return *failure;
    return place->second;
  }
  if (auto failure = obstacle(options)) return *failure;
  return streams_.emplace(name, std::make_shared<SendStream>(uplink_, *this, to, options))
      .first->second;
}

Outcome<StreamTable::Stream> StreamTable::service_stream(const std::string& full_name,
                                                         const ServicePlace& place,
                                                         const SendOptions& options) {
  const MutexLock lock(mutex_);
  const auto known = services_.find(full_name);
  if (known != services_.end()) {
    known->second.asked = ++asked_;
    return known->second.stream;
  }
  if (auto failure = obstacle(options)) return *failure;
  auto made = std::make_shared<SendStream>(uplink_, *this, full_name, place, options);
  if (place.destination() != 0) by_group_[place.group] = made;
  services_.emplace(full_name, Service{made, ++asked_});
  return made;
}

std::optional<std::string> StreamTable::make_place(const std::string& full_name) {
  const MutexLock lock(mutex_);
  if (services_.size() < kServicesKept || services_.contains(full_name)) return std::nullopt;
  auto oldest = services_.end();
  for (auto each = services_.begin(); each != services_.end(); ++each) {
    if (oldest != services_.end() && oldest->second.asked < each->second.asked) continue;
    // The table itself has one reference, and another where the group is known.
    const SendStream* const stream = each->second.stream.get();
    const auto group = by_group_.find(each->second.stream->group());
    const bool grouped = group != by_group_.end() && group->second.get() == stream;
    if (each->second.stream.use_count() > (grouped ? 2 : 1)) continue;
    if (each->second.stream->idle()) oldest = each;
  }
  if (oldest == services_.end()) return std::nullopt;
  std::string name = oldest->first;
  const Stream stream = oldest->second.stream;
  std::erase_if(by_group_, [&stream](const auto& entry) { return entry.second == stream; });
  services_.erase(oldest);
  return name;
}

bool StreamTable::has_service(const std::string& full_name) {
  const MutexLock lock(mutex_);
  return services_.contains(full_name);
}

void StreamTable::on_service_moved(const std::string& full_name, const ServicePlace& place) {
  Stream stream;
  {
    const MutexLock lock(mutex_);
    const auto known = services_.find(full_name);
    if (known == services_.end()) return;
    stream = known->second.stream;
    std::erase_if(by_group_, [&stream](const auto& entry) { return entry.second == stream; });
    if (place.destination() != 0) by_group_[place.group] = stream;
  }
  stream->on_moved(place);
}

StreamTable::Stream StreamTable::standing(const std::string& full_name) {
  const MutexLock lock(mutex_);
  const auto known = services_.find(full_name);
  if (known == services_.end() || known->second.stream->group() == 0) return nullptr;
  known->second.asked = ++asked_;
  return known->second.stream;
}

StreamTable::Stream StreamTable::find(const StreamName& name) {
  const MutexLock lock(mutex_);
  if (name.group != 0) {
    const auto service = by_group_.find(name.group);
    return service == by_group_.end() ? nullptr : service->second;
  }
  const auto place = streams_.find(name);
  return place == streams_.end() ? nullptr : place->second;
}

std::vector<StreamTable::Stream> StreamTable::all() {
  const MutexLock lock(mutex_);
  std::vector<Stream> streams;
  streams.reserve(streams_.size() + services_.size());
  for (const auto& [name, stream] : streams_) streams.push_back(stream);
  for (const auto& [name, service] : services_) streams.push_back(service.stream);
  return streams;
}

void StreamTable::on_ack(const StreamName& name, const proto::gimi::MessageHeader& header,
                         const proto::gimi::Ack& ack) {
  const Stream stream = find(name);
  if (stream == nullptr || stream->epoch() != header.epoch) return;
  if (stream->on_ack(header.sequence, ack)) attend_(true);
}

bool StreamTable::on_refused(const StreamName& name, const proto::gimi::MessageHeader& header,
                             const Loss& why) {
  const Stream stream = find(name);
  if (stream == nullptr || stream->epoch() != header.epoch) return false;
  stream->on_refused(header.sequence, why);
  return true;
}

void StreamTable::on_report(const Report& report) {
  const Loss why = reported_loss(report.reason, report.text);
  if (is_route_gone(report.reason) && report.name.group != 0) {
    if (const Stream stream = find(report.name); stream != nullptr) stream->on_broken(why);
    return;
  }
  if (is_route_gone(report.reason)) {
    for (const Stream& stream : all()) {
      if (stream->to() == report.name.peer) stream->on_broken(why);
    }
    return;
  }
  if (!report.has_key && report.name.group == 0) {
    for (const Stream& stream : all()) {
      if (stream->to() == report.name.peer) stream->on_doubt(why);
    }
    return attend_(true);
  }
  const Stream stream = find(report.name);
  if (stream == nullptr || (report.sequence != 0 && report.epoch != stream->epoch())) return;
  if (report.sequence != 0) stream->on_lost(report.sequence, why);
  if (report.sequence != 0 && report.count == 1) return;
  stream->on_doubt(why);
  attend_(true);
}

void StreamTable::on_doubt(const Loss& why) {
  for (const Stream& stream : all()) stream->on_doubt(why);
  attend_(true);
}

void StreamTable::on_broken(const Loss& why) {
  for (const Stream& stream : all()) stream->on_broken(why);
}

void StreamTable::end(const Ending& ending) {
  for (const Stream& stream : all()) stream->end(ending);
}

void StreamTable::watch(SendStream& stream) {
  {
    const MutexLock lock(mutex_);
    watched_.push_back(&stream);
  }
  attend_(false);
}

bool StreamTable::tick(std::int64_t now_ns) {
  const std::int64_t interrupted_ns = interrupted_ns_.load();
  if (interrupted_ns != 0 && now_ns - interrupted_ns > kGraceNs) {
    on_broken({LossReason::connection_lost,
               "the connection to the hub broke and did not come back in time"});
  }
  std::vector<SendStream*> watched;
  {
    const MutexLock lock(mutex_);
    watched.swap(watched_);
  }
  std::erase_if(watched, [now_ns](SendStream* stream) { return !stream->tick(now_ns); });
  const MutexLock lock(mutex_);
  watched_.insert(watched_.end(), watched.begin(), watched.end());
  return !watched_.empty();
}

}  // namespace gimnet::gimi
