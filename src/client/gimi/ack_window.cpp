#include "client/gimi/ack_window.hpp"

#include <algorithm>

#include "base/check.hpp"

namespace gimnet::gimi {
namespace {

constexpr std::int64_t kPatienceMinNs = 200'000'000;
constexpr std::int64_t kPatienceRoundTrips = 4;
/// A PING that is not answered is repeated, each time after twice as long, up to 16 times the
/// patience.
constexpr std::uint32_t kDoublingsMax = 4;

bool at_or_before(std::uint32_t sequence, std::uint32_t other) {
  return static_cast<std::int32_t>(other - sequence) >= 0;
}

}  // namespace

bool AckWindow::says_taken(std::uint32_t highest, std::uint64_t bitmap, std::uint32_t sequence) {
  const std::uint32_t behind = highest - sequence;
  if (behind == 0) return true;
  return behind <= 64 && ((bitmap >> (behind - 1)) & 1) != 0;
}

bool AckWindow::has_room(std::size_t bytes) const {
  // The receiver's library holds so much for a program that stands still: no more may be under way,
  // or it would wait in a hub.
  const bool fits = unacknowledged_ == 0 || unacknowledged_bytes_ + bytes <= kWindowBytesMax;
  // The span keeps the oldest within reach of the bitmap of any ACK.
  return fits && unacknowledged_ < messages_max_ &&
         (waiting_.empty() || next_sequence_ - waiting_.front().sequence <= kWindowMax);
}

void AckWindow::free(Waiting& waiting) {
  waiting.acknowledged = true;
  --unacknowledged_;
  unacknowledged_bytes_ -= waiting.bytes;
}

std::uint32_t AckWindow::open(std::size_t bytes, std::int64_t now_ns) {
  GIMNET_ASSERT(has_room(bytes));
  const std::uint32_t sequence = next_sequence_++;
  waiting_.push_back({sequence, false, bytes, now_ns});
  ++unacknowledged_;
  unacknowledged_bytes_ += bytes;
  return sequence;
}

bool AckWindow::waits_for(std::uint32_t sequence) const {
  return std::ranges::any_of(waiting_, [sequence](const Waiting& waiting) {
    return waiting.sequence == sequence && !waiting.acknowledged;
  });
}

bool AckWindow::cancel(std::uint32_t sequence) {
  GIMNET_ASSERT(sequence + 1 == next_sequence_);
  next_sequence_ = sequence;
  if (waiting_.empty() || waiting_.back().sequence != sequence) return false;
  if (!waiting_.back().acknowledged) free(waiting_.back());
  waiting_.pop_back();
  return true;
}

AckWindow::Freed AckWindow::acknowledge(std::uint32_t highest, std::uint64_t bitmap,
                                        std::uint32_t pong, std::int64_t now_ns) {
  Freed freed;
  const bool answers_ping = pong != 0 && pong == ping_number_;
  for (Waiting& waiting : waiting_) {
    if (waiting.acknowledged) continue;
    if (says_taken(highest, bitmap, waiting.sequence)) {
      free(waiting);
      ++freed.acknowledged;
      if (waiting.sequence == highest && pong == 0) round_trip_ns_ = now_ns - waiting.sent_ns;
    } else if (answers_ping && at_or_before(waiting.sequence, ping_covers_)) {
      free(waiting);
      ++freed.lost;
    }
  }
  if (answers_ping) ping_number_ = 0;
  drop_front();
  return freed;
}

AckWindow::Freed AckWindow::lose(std::uint32_t sequence) {
  for (Waiting& waiting : waiting_) {
    if (waiting.sequence != sequence || waiting.acknowledged) continue;
    free(waiting);
    drop_front();
    return {0, 1};
  }
  return {};
}

AckWindow::Freed AckWindow::lose_all() {
  const Freed freed{0, unacknowledged_};
  waiting_.clear();
  unacknowledged_ = 0;
  unacknowledged_bytes_ = 0;
  drop_front();
  return freed;
}

bool AckWindow::ping_due(std::int64_t now_ns) const {
  if (unacknowledged_ == 0) return false;
  if (ping_number_ != 0) return now_ns >= ping_again_ns_;
  return hurried_ || now_ns >= waiting_.front().sent_ns + patience_ns();
}

void AckWindow::ping_sent(std::uint32_t number, std::int64_t now_ns) {
  hurried_ = false;
  if (number != ping_number_) {
    ping_number_ = number;
    ping_covers_ = next_sequence_ - 1;
    pings_ = 0;
  }
  ping_again_ns_ = now_ns + (patience_ns() << std::min(pings_, kDoublingsMax));
  ++pings_;
}

void AckWindow::ping_not_sent() {
  if (ping_number_ == 0) return;  // an ACK freed everything meanwhile
  ping_again_ns_ = 0;
  --pings_;
}

std::int64_t AckWindow::patience_ns() const {
  return std::max(kPatienceRoundTrips * round_trip_ns_, kPatienceMinNs);
}

void AckWindow::drop_front() {
  while (!waiting_.empty() && waiting_.front().acknowledged) waiting_.pop_front();
  if (waiting_.empty()) {
    ping_number_ = 0;
    hurried_ = false;
  }
}

}  // namespace gimnet::gimi
