#include "impair/delayed_channel.hpp"

#include <algorithm>

#include "base/check.hpp"

namespace gimnet::impair {
namespace {

constexpr double kSecond = 1e9;
constexpr std::size_t kPieceMax = 64 << 10;
/// A slow line lets a piece of this many parts of a second out at once.
constexpr std::uint64_t kPiecesPerSecond = 100;

}  // namespace

std::size_t DelayedChannel::room(const Impairment& how) const {
  const std::uint64_t most = how.queue_bytes();
  return held_ < most ? static_cast<std::size_t>(most - held_) : 0;
}

std::size_t DelayedChannel::piece_bytes(const Impairment& how) {
  std::uint64_t most = kPieceMax;
  if (how.rate != 0) most = std::clamp<std::uint64_t>(how.rate / kPiecesPerSecond, 1, most);
  if (how.split != 0)
    most = std::min(most, std::uniform_int_distribution<std::uint64_t>(1, how.split)(random_));
  return static_cast<std::size_t>(most);
}

void DelayedChannel::put(std::int64_t now_ns, const Impairment& how,
                         std::span<const std::byte> bytes) {
  held_ += bytes.size();
  while (!bytes.empty()) {
    const auto piece = bytes.first(std::min(bytes.size(), piece_bytes(how)));
    bytes = bytes.subspan(piece.size());
    std::int64_t due = now_ns;
    if (how.rate != 0) {
      const double takes =
          static_cast<double>(piece.size()) * kSecond / static_cast<double>(how.rate);
      line_free_ns_ = std::max(line_free_ns_, now_ns) + static_cast<std::int64_t>(takes);
      due = line_free_ns_;
    }
    due += how.delay_ns;
    if (how.jitter_ns != 0)
      due += std::uniform_int_distribution<std::int64_t>(-how.jitter_ns, how.jitter_ns)(random_);
    last_due_ns_ = std::max({due, last_due_ns_, now_ns});
    pieces_.push_back({last_due_ns_, {piece.begin(), piece.end()}});
  }
}

std::span<const std::byte> DelayedChannel::due(std::int64_t now_ns) const {
  if (due_ns() > now_ns) return {};
  return std::span(pieces_.front().bytes).subspan(taken_);
}

std::int64_t DelayedChannel::due_ns() const {
  return pieces_.empty() ? kNever : pieces_.front().due_ns;
}

void DelayedChannel::took(std::size_t count) {
  GIMNET_CHECK(!pieces_.empty() && count <= pieces_.front().bytes.size() - taken_);
  held_ -= count;
  taken_ += count;
  if (taken_ < pieces_.front().bytes.size()) return;
  pieces_.pop_front();
  taken_ = 0;
}

}  // namespace gimnet::impair
