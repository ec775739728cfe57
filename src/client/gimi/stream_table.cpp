#include "client/gimi/stream_table.hpp"

#include <utility>

#include "client/gimi/report_words.hpp"
#include "proto/frame/report.hpp"

namespace gimnet::gimi {
namespace {

/// The grace time of a hub, if nobody changed it.
constexpr std::int64_t kGraceNs = 30'000'000'000;

/// After these nothing arrives there any more, and no ACK comes back.
bool is_route_gone(std::uint32_t reason) {
  switch (static_cast<proto::DropReason>(reason)) {
    case proto::DropReason::no_such_node:
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

Outcome<SendStream*> StreamTable::stream(Peer to, const SendOptions& options) {
  if (!to) return Failure{Status::bad_argument, "cannot send to nobody: the peer's id is 0"};
  if (options.window > kWindowMax) {
    return Failure{Status::bad_argument, "a window of " + std::to_string(options.window) +
                                             " messages is more than one ACK can speak of: at most " +
                                             std::to_string(kWindowMax)};
  }
  const MutexLock lock(mutex_);
  const StreamName name{to, options.key};
  const auto place = streams_.find(name);
  if (place != streams_.end()) return place->second.get();
  if (streams_.size() >= kStreamsMax) {
    return Failure{Status::limit, "this node sends to " + std::to_string(kStreamsMax) + " (peer, key) already"};
  }
  return streams_.emplace(name, std::make_unique<SendStream>(uplink_, *this, to, options)).first->second.get();
}

SendStream* StreamTable::find(const StreamName& name) {
  const MutexLock lock(mutex_);
  const auto place = streams_.find(name);
  return place == streams_.end() ? nullptr : place->second.get();
}

std::vector<SendStream*> StreamTable::all() {
  const MutexLock lock(mutex_);
  std::vector<SendStream*> streams;
  streams.reserve(streams_.size());
  for (const auto& [name, stream] : streams_) streams.push_back(stream.get());
  return streams;
}

void StreamTable::on_ack(const StreamName& name, std::uint32_t sequence, const proto::gimi::Ack& ack) {
  SendStream* stream = find(name);
  if (stream != nullptr && stream->on_ack(sequence, ack)) attend_(true);
}

void StreamTable::on_report(const Report& report) {
  const std::string why = report_words(report.text);
  if (is_route_gone(report.reason)) {
    for (SendStream* stream : all()) {
      if (stream->to() == report.name.peer) stream->on_broken(why);
    }
    return;
  }
  SendStream* stream = find(report.name);
  if (stream == nullptr) return;
  if (report.sequence != 0) stream->on_lost(report.sequence, why);
  if (report.sequence != 0 && report.count == 1) return;
  stream->on_doubt();
  attend_(true);
}

void StreamTable::on_broken(const std::string& why) {
  for (SendStream* stream : all()) stream->on_broken(why);
}

void StreamTable::close() {
  for (SendStream* stream : all()) stream->close();
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
    on_broken("the connection to the hub broke and did not come back in time");
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
