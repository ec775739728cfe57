#include "client/gimi/clerk.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <utility>

#include "base/clock.hpp"
#include "client/gimi/inbox.hpp"
#include "client/gimi/open_requests.hpp"
#include "client/gimi/stream_table.hpp"

namespace gimnet::gimi {
namespace {

constexpr std::uint32_t kBits = 64;

void advance(AckBook::Entry& entry, std::uint32_t sequence) {
  const std::uint32_t step = sequence - entry.sequence;
  entry.bitmap = step >= kBits ? 0 : entry.bitmap << step;
  if (step <= kBits) entry.bitmap |= std::uint64_t{1} << (step - 1);
  entry.sequence = sequence;
}

}  // namespace

bool AckBook::take(const StreamName& sender, const proto::gimi::MessageHeader& data) {
  if (entries_.size() >= kStreamsMax && !entries_.contains(sender)) {
    // A sender that begins too many streams loses its own.
    const auto above = entries_.lower_bound(sender);
    entries_.erase(above != entries_.begin() ? std::prev(above) : above);
  }
  const auto [place, is_new] =
      entries_.try_emplace(sender, Entry{data.epoch, data.sequence, 0, true});
  if (is_new) return true;
  Entry& entry = place->second;
  const bool was_due = std::exchange(entry.due, true);
  const auto distance = static_cast<std::int32_t>(data.sequence - entry.sequence);
  if (data.epoch != entry.epoch) {
    entry = {data.epoch, data.sequence, 0, true};
  } else if (distance > 0) {
    advance(entry, data.sequence);
  } else if (distance < 0 && distance >= -static_cast<std::int32_t>(kBits)) {
    entry.bitmap |= std::uint64_t{1} << (static_cast<std::uint32_t>(-distance) - 1);
  }
  return !was_due;
}

AckBook::Entry AckBook::acknowledge(const StreamName& sender) {
  const auto found = entries_.find(sender);
  if (found == entries_.end()) return {};
  found->second.due = false;
  return found->second;
}

void AckBook::hold(const StreamName& sender) {
  if (const auto found = entries_.find(sender); found != entries_.end()) found->second.due = true;
}

namespace {

/// The time between two looks at the streams: a quarter of the shortest patience.
constexpr std::int64_t kTickNs = 50'000'000;
/// The time until the next try if the hub had paused the way of an ACK.
constexpr std::int64_t kRetryNs = 5'000'000;
/// ACKs that wait for their way; whoever misses another one asks for it by a PING.
constexpr std::size_t kPausedAcksMax = 1024;
/// A node that leaves tries for so long to send its last ACKs.
constexpr std::int64_t kLastAcksNs = 500'000'000;

}  // namespace

void Clerk::stop() {
  // Partner: run(), which sees it at the turn for which it is roused.
  give_up_ns_.store(steady_now_ns() + kLastAcksNs);
  uplink_.rouse();
  {
    const MutexLock lock(mutex_);
    while (!stopped_) static_cast<void>(done_.wait_until(mutex_, INT64_MAX));
  }
  uplink_.set_task({});
}

void Clerk::take(const StreamName& sender, Lane lane, const proto::gimi::MessageHeader& data) {
  if (book_.take(sender, data)) due_.push_back({sender, lane});
}

nif_status Clerk::acknowledge(const StreamName& sender, Lane lane,
                              const proto::gimi::MessageHeader& ping) {
  AckBook::Entry taken = book_.acknowledge(sender);
  // Nothing was taken of the epoch of which it asks.
  if (taken.epoch != ping.epoch) taken = {.epoch = ping.epoch};
  return send_ack(sender, lane, taken, ping.sequence);
}

nif_status Clerk::send_ack(const StreamName& sender, Lane lane, AckBook::Entry taken,
                           std::uint32_t pong) const {
  std::array<std::byte, proto::gimi::kAckSizeMax> memory;
  const std::size_t size = proto::gimi::encode_ack({taken.bitmap, pong, sender.group}, memory);
  const std::span<const std::byte> data = std::span(memory).first(size);
  const Envelope envelope{sender.peer.id, NIF_UNICAST, NIF_POLICY_DEFAULT, lane, sender.key, 0, 0};
  return uplink_.transmit(envelope,
                          {taken.sequence, proto::gimi::MessageOperation::ack, 0, 0, taken.epoch},
                          false, data, 0);
}

void Clerk::attend(bool at_once) {
  // Partner: tick(), which takes these back before it looks. So nothing is missed that was there
  // before the call.
  const bool wanted = at_once ? hurry_.exchange(true) : ticking_.exchange(true);
  if (!wanted) uplink_.rouse();
}

net::Deadline Clerk::run() {
  const std::int64_t give_up_ns = give_up_ns_.load();
  const bool idle =
      due_.empty() && paused_.empty() && give_up_ns == INT64_MAX && inbox_due_ns() == INT64_MAX;
  if (idle && !ticking_.load() && !hurry_.load() && tick_at_ns_ == INT64_MAX) return net::kNever;
  if (!due_.empty() || steady_now_ns() >= retry_at_ns_) send_due();
  const std::int64_t now = steady_now_ns();
  tick(now);
  if (give_up_ns != INT64_MAX && (paused_.empty() || now >= give_up_ns)) {
    const MutexLock lock(mutex_);
    stopped_ = true;
    done_.notify_all();
  }
  // Its own work may want a look at once.
  return hurry_.load() ? now : std::min({tick_at_ns_, retry_at_ns_, inbox_due_ns()});
}

std::int64_t Clerk::inbox_due_ns() const {
  return inbox_ != nullptr ? inbox_->due_ns() : INT64_MAX;
}

void Clerk::tick(std::int64_t now_ns) {
  if (tick_at_ns_ == INT64_MAX && ticking_.load()) tick_at_ns_ = now_ns + kTickNs;
  if (!hurry_.exchange(false) && now_ns < std::min(tick_at_ns_, inbox_due_ns())) return;
  ticking_.store(false);
  const bool streams = streams_.tick(now_ns);
  const bool requests = requests_ != nullptr && requests_->tick(now_ns);
  const bool silences = inbox_ != nullptr && inbox_->tick();
  const bool more = streams || requests || silences;
  if (more) ticking_.store(true);
  tick_at_ns_ = more ? now_ns + kTickNs : INT64_MAX;
}

void Clerk::send_due() {
  due_.insert(due_.end(), paused_.begin(), paused_.end());
  paused_.clear();
  for (const Due& ack : due_) {
    if (send_ack(ack.sender, ack.lane, book_.acknowledge(ack.sender), 0) != NIF_TIMEOUT) continue;
    if (paused_.size() == kPausedAcksMax) continue;
    book_.hold(ack.sender);
    paused_.push_back(ack);
  }
  due_.clear();
  retry_at_ns_ = paused_.empty() ? INT64_MAX : steady_now_ns() + kRetryNs;
}

}  // namespace gimnet::gimi
