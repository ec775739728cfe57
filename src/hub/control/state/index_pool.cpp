#include "hub/control/state/index_pool.hpp"

#include <algorithm>
#include <bit>

#include "base/check.hpp"

namespace gimnet::hub {

void IndexSet::insert(std::uint32_t index) {
  if (contains(index)) return;
  if (index / 8 >= bytes_.size()) bytes_.resize(index / 8 + 1);
  bytes_[index / 8] |= bit(index);
  ++size_;
}

void IndexSet::erase(std::uint32_t index) {
  if (!contains(index)) return;
  bytes_[index / 8] &= ~bit(index);
  --size_;
}

std::span<const std::byte> IndexSet::bytes() const {
  std::size_t size = bytes_.size();
  while (size > 0 && bytes_[size - 1] == std::byte{0}) --size;
  return std::span{bytes_}.first(size);
}

std::optional<IndexSet> IndexSet::from_bytes(std::span<const std::byte> bytes, std::uint32_t most) {
  if (bytes.empty()) return IndexSet{};
  if (bytes.size() > bytes_max(most)) return std::nullopt;
  const auto last = std::to_integer<unsigned>(bytes.back());
  if (last == 0 || (bytes.front() & bit(0)) != std::byte{0}) return std::nullopt;
  const std::size_t highest =
      8 * (bytes.size() - 1) + static_cast<std::size_t>(std::bit_width(last)) - 1;
  if (highest > most) return std::nullopt;
  IndexSet set;
  set.bytes_.assign(bytes.begin(), bytes.end());
  for (const std::byte each : bytes) {
    set.size_ += static_cast<std::uint32_t>(std::popcount(std::to_integer<unsigned>(each)));
  }
  return set;
}

bool operator==(const IndexSet& a, const IndexSet& b) {
  return std::ranges::equal(a.bytes(), b.bytes());
}

namespace {

/// Forgetting goes over all indices, and is kept on the disk: what it gains has to be worth that.
std::uint32_t worth_forgetting(std::uint32_t most) {
  return std::min(IndexPool::kBlock / 2, most / 512 + 1);
}

}  // namespace

std::chrono::milliseconds index_resting_time(const Limits& limits) {
  return std::chrono::milliseconds{limits.grace_ms +
                                   std::max(limits.block_ms, limits.slow_consumer_ms)};
}

IndexPool::IndexPool(std::uint32_t most, std::chrono::milliseconds resting_time,
                     const IndexRange& range, std::chrono::milliseconds returns_until)
    : most_(most),
      resting_time_(resting_time),
      first_(range.first),
      keeps_nothing_(range.count == IndexRange::kAll),
      returns_until_(returns_until),
      end_(std::min<std::uint64_t>(range.count, most)),
      used_(range.used) {
  GIMNET_CHECK(first_ > 0 && first_ <= most_);
  for (std::uint64_t position = 0; position < end_; ++position)
    granted_left_ += used(index_at(position)) ? 0 : 1;
}

bool IndexPool::ready(std::chrono::milliseconds now) {
  wake(now);
  if (granted_left_ == 0 && keeps_nothing_ && forgetting_due(now)) grant(next_grant(now));
  return granted_left_ > 0;
}

std::optional<std::uint32_t> IndexPool::take(std::chrono::milliseconds now) {
  if (!ready(now)) return std::nullopt;
  while (used(index_at(position_))) ++position_;
  const std::uint32_t index = index_at(position_);
  hold(index);
  ++position_;
  return index;
}

bool IndexPool::take_free(std::uint32_t index, std::chrono::milliseconds now) {
  wake(now);
  if (index == 0 || index > most_ || taken_.contains(index)) return false;
  hold(index);
  return true;
}

void IndexPool::let_go(std::uint32_t index) {
  GIMNET_CHECK(held(index) && held_ > 0);
  --held_;
  taken_.erase(index);
}

bool IndexPool::take_back(std::uint32_t index) {
  if (index == 0 || index > most_ || held(index)) return false;
  rests_until_.erase(index);
  hold(index);
  return true;
}

void IndexPool::give_back(std::uint32_t index, std::chrono::milliseconds now) {
  GIMNET_CHECK(held(index) && held_ > 0);
  --held_;
  rests_until_[index] = now + resting_time_;
  resting_.add({now + resting_time_, index}, rests_until_.size(),
               [this](const Resting& each) { return !still_rests(each); });
  wake(now);
}

bool IndexPool::held(std::uint32_t index) const {
  return taken_.contains(index) && !rests_until_.contains(index);
}

void IndexPool::put_off_returns(std::chrono::milliseconds by, std::chrono::milliseconds latest) {
  returns_until_ = std::min(returns_until_ + by, latest);
}

std::optional<std::chrono::milliseconds> IndexPool::waits_for_returns(
    std::chrono::milliseconds now) const {
  if (unused() > 0 || now >= returns_until_) return std::nullopt;
  return returns_until_ - now;
}

bool IndexPool::waits_for_keeping(std::chrono::milliseconds now) const {
  return keeping_failed_ && granted_left_ == 0 && keeping_due(now);
}

bool IndexPool::keeping_due(std::chrono::milliseconds now) const {
  if (keeps_nothing_) return false;
  const bool runs_short = granted_left_ < kBlock / 2 && granted_left_ < unused();
  return unkept_ || runs_short || forgetting_due(now);
}

IndexPool::Grant IndexPool::next_grant(std::chrono::milliseconds now) const {
  Grant next;
  next.forgets_gone = forgetting_due(now);
  next.used = next.forgets_gone ? taken_ : used_;
  next.count = position_;
  std::uint64_t left = 0;
  // Granted indices stay granted. More are granted up to the last one that is not used: the used
  // ones behind it may be forgotten one day, and must not be granted before.
  std::uint64_t most = next.forgets_gone            ? kBlock
                       : granted_left_ < kBlock / 2 ? granted_left_ + kBlock
                                                    : granted_left_;
  if (keeps_nothing_) most = most_;
  for (std::uint64_t position = position_; left < most && position < position_ + most_;
       ++position) {
    const std::uint32_t index = index_at(position);
    if (next.used.contains(index)) continue;
    next.used.insert(index);
    ++left;
    next.count = position + 1;
  }
  next.mark = index_at(next.count);
  return next;
}

void IndexPool::grant(const Grant& grant) {
  GIMNET_CHECK(grant.count >= position_ && grant.count <= position_ + most_);
  if (grant.forgets_gone) used_ = taken_;
  end_ = grant.count;
  granted_left_ = 0;
  for (std::uint64_t position = position_; position < end_; ++position)
    granted_left_ += used(index_at(position)) ? 0 : 1;
  unkept_ = keeping_failed_ = false;
}

std::uint32_t IndexPool::index_at(std::uint64_t position) const {
  return static_cast<std::uint32_t>((first_ - 1 + position) % most_) + 1;
}

bool IndexPool::granted(std::uint32_t index) const {
  return (index + most_ - index_at(position_)) % most_ < end_ - position_;
}

/// Early enough that a restart, after which nothing is forgotten for a time, finds many that are
/// not used.
bool IndexPool::forgetting_due(std::chrono::milliseconds now) const {
  if (now < returns_until_) return false;
  if (2 * std::uint64_t{unused()} >= most_) return false;
  return used_.size() - taken_.size() >= worth_forgetting(most_);
}

void IndexPool::hold(std::uint32_t index) {
  if (!used(index)) {
    if (granted(index)) {
      --granted_left_;
    } else {
      unkept_ = true;
    }
    used_.insert(index);
  }
  taken_.insert(index);
  ++held_;
}

/// It was not taken back meanwhile, and perhaps given back anew.
bool IndexPool::still_rests(const Resting& note) const {
  const auto found = rests_until_.find(note.index);
  return found != rests_until_.end() && found->second == note.until;
}

void IndexPool::wake(std::chrono::milliseconds now) {
  while (!resting_.empty() && resting_.front().until <= now) {
    const Resting rested = resting_.front();
    resting_.pop_front();
    if (!still_rests(rested)) continue;
    rests_until_.erase(rested.index);
    taken_.erase(rested.index);
  }
}

std::string IndexPool::shortage(const std::string& kind, std::chrono::milliseconds now) const {
  if (waits_for_keeping(now)) {
    return "this hub cannot write its state, and has no " + kind +
           " left until it can; its log says why (a full disk?), try again when that is mended";
  }
  const std::optional<std::chrono::milliseconds> wait = waits_for_returns(now);
  if (!wait)
    return "all " + kind +
           " that this hub may hand out are in use or resting; try again in a minute";
  return "this hub was restarted a moment ago, and those who had its " + kind +
         " may still come back; try again in " + std::to_string((wait->count() + 999) / 1'000) +
         " s";
}

}  // namespace gimnet::hub
