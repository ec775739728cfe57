#include "client/gimi/clerk.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <utility>

#include "base/clock.hpp"
#include "base/signals_blocked.hpp"
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

bool AckBook::hold(const StreamName& sender) {
  const auto found = entries_.find(sender);
  return found == entries_.end() || std::exchange(found->second.due, true);
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

void Clerk::start() {
  const SignalsBlocked blocked;
  thread_ = std::thread([this] { run(); });
}

void Clerk::stop() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  work_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void Clerk::take(const StreamName& sender, Lane lane, const proto::gimi::MessageHeader& data) {
  {
    const MutexLock lock(mutex_);
    if (!book_.take(sender, data)) return;
    due_.push_back({sender, lane});
    if (due_.size() != 1) return;
  }
  work_.notify_one();
}

nif_status Clerk::acknowledge(const StreamName& sender, Lane lane,
                              const proto::gimi::MessageHeader& ping) {
  AckBook::Entry taken;
  {
    const MutexLock lock(mutex_);
    taken = book_.acknowledge(sender);
  }
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
  {
    const MutexLock lock(mutex_);
    if (ticking_ && !at_once) return;
    ticking_ = true;
    hurry_ = hurry_ || at_once;
  }
  work_.notify_one();
}

void Clerk::wait_for_work(std::int64_t& tick_at, bool paused) {
  const std::int64_t retry_at = paused ? steady_now_ns() + kRetryNs : INT64_MAX;
  for (;;) {
    if (!ticking_) {
      tick_at = INT64_MAX;
    } else if (tick_at == INT64_MAX) {
      tick_at = steady_now_ns() + kTickNs;
    }
    if (std::exchange(hurry_, false)) tick_at = 0;
    // The streams are looked after however many ACKs are due, or wait for their way.
    if (!due_.empty() || (stopping_ && !paused)) return;
    const std::int64_t until = std::min(tick_at, retry_at);
    if (steady_now_ns() >= until) return;
    static_cast<void>(work_.wait_until(mutex_, until));
  }
}

void Clerk::run() {
  std::vector<Due> due;
  std::vector<Due> paused;
  std::int64_t tick_at = INT64_MAX;
  std::int64_t give_up_at = INT64_MAX;
  for (;;) {
    {
      const MutexLock lock(mutex_);
      wait_for_work(tick_at, !paused.empty());
      if (stopping_ && give_up_at == INT64_MAX) give_up_at = steady_now_ns() + kLastAcksNs;
      if (stopping_ && due_.empty() && (paused.empty() || steady_now_ns() >= give_up_at)) return;
      due.swap(due_);
    }
    due.insert(due.end(), paused.begin(), paused.end());
    paused.clear();
    send_due(due);
    paused.swap(due);
    const std::int64_t now = steady_now_ns();
    if (now < tick_at) continue;
    tick_at = now + kTickNs;
    const bool streams = streams_.tick(now);
    const bool requests = requests_ != nullptr && requests_->tick(now);
    const bool silences = inbox_ != nullptr && inbox_->tick();
    const MutexLock lock(mutex_);
    if (!streams && !requests && !silences && !hurry_) ticking_ = false;
  }
}

void Clerk::send_due(std::vector<Due>& due) {
  std::size_t kept = 0;
  std::erase_if(due, [this, &kept](const Due& ack) {
    AckBook::Entry taken;
    {
      const MutexLock lock(mutex_);
      taken = book_.acknowledge(ack.sender);
    }
    if (send_ack(ack.sender, ack.lane, taken, 0) != NIF_TIMEOUT) return true;
    const MutexLock lock(mutex_);
    if (kept == kPausedAcksMax || book_.hold(ack.sender)) return true;
    ++kept;
    return false;
  });
}

}  // namespace gimnet::gimi
