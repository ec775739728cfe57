#include "generator/flood.hpp"

#include <algorithm>
#include <utility>

namespace gimnet::perf {
namespace {

constexpr std::size_t kWriteBytes = 64 * 1024;
constexpr std::size_t kWindowBytes = 2 * 1024 * 1024;
constexpr std::size_t kWindowBytesARecipient = 128 * 1024;
constexpr std::size_t kUnbatchedMessages = 64;
constexpr std::uint64_t kFirstMessages = 16;
constexpr std::uint64_t kGrowth = 4;
/// A subject that takes longer for a round gets no larger ones, or it would be at them long after
/// the run's end.
constexpr std::chrono::milliseconds kSlowRound{400};
/// Writes of a publisher in one turn where each is a single message.
constexpr std::size_t kUnbatchedWrites = 8;
constexpr std::chrono::milliseconds kPatience{1};

}  // namespace

Publisher::Publisher(Wire& wire, Client& from, const std::vector<Target>& targets,
                     MessageShape shape, Writing writing)
    : from_(from), writing_(writing), messages_a_write_(1) {
  const auto payload = pattern_payload(shape.payload_bytes);
  // Whole rounds through the targets, so that each gets the same share.
  do {
    for (const Target& target : targets)
      wire.append_message(from, target, shape.lane, payload, block_);
  } while (block_.bytes.size() + targets.size() * block_.message_bytes() <= kWriteBytes);
  if (writing == Writing::batched) {
    messages_a_write_ =
        std::clamp<std::size_t>(kWriteBytes / block_.message_bytes(), 1, block_.message_count());
  }
  next_message_ = block_.message_count();
}

std::size_t Publisher::publish(std::uint64_t messages_max, std::uint64_t cut_to) {
  if (!from_.flush() || !from_.paused.empty()) return 0;
  if (next_message_ == block_.message_count()) {
    block_.renew();
    next_message_ = 0;
  }
  const auto whole = std::min(messages_a_write_, block_.message_count() - next_message_);
  const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(whole, cut_to));
  if (count > messages_max || count == 0) return 0;
  const std::size_t begin = next_message_ == 0 ? 0 : block_.message_end(next_message_ - 1);
  const std::size_t end = block_.message_end(next_message_ + count - 1);
  from_.write(std::span<const std::byte>(block_.bytes).subspan(begin, end - begin));
  next_message_ += count;
  return count;
}

Flood::Flood(Engine& engine, std::vector<Publisher> publishers, std::size_t recipients_a_message)
    : engine_(engine),
      publishers_(std::move(publishers)),
      recipients_a_message_(recipients_a_message),
      message_bytes_(publishers_.front().message_bytes()),
      window_bytes_(std::max(kWindowBytes, kWindowBytesARecipient * recipients_a_message)),
      is_unbatched_(publishers_.front().is_unbatched()) {}

std::uint64_t Flood::window() const {
  std::uint64_t deliveries = window_bytes_ / message_bytes_;
  if (is_unbatched_)
    deliveries = std::min<std::uint64_t>(deliveries, kUnbatchedMessages * recipients_a_message_);
  return std::max<std::uint64_t>(1, deliveries / recipients_a_message_);
}

std::uint64_t Flood::messages_allowed() const {
  const std::uint64_t most = std::min(window(), messages_max_);
  const std::uint64_t under_way =
      (expected_ - settled_ - missing_ + recipients_a_message_ - 1) / recipients_a_message_;
  if (under_way == 0)
    return UINT64_MAX;  // a write larger than the window could not start otherwise
  return under_way >= most ? 0 : most - under_way;
}

void Flood::warm_up(std::chrono::nanoseconds duration) {
  for (messages_max_ = kFirstMessages; messages_max_ < window(); messages_max_ *= kGrowth) {
    const auto begin = Clock::now();
    const std::uint64_t before = expected_;
    while (expected_ - before < messages_max_ * recipients_a_message_) turn(kPatience);
    drain();
    if (Clock::now() - begin > kSlowRound) break;
  }
  if (messages_max_ >= window()) messages_max_ = UINT64_MAX;
  run_for(duration);
  drain();
}

bool Flood::publish() {
  bool any = false;
  for (auto& publisher : publishers_) {
    const std::size_t writes = is_unbatched_ ? kUnbatchedWrites : 1;
    for (std::size_t write = 0; write < writes; ++write) {
      const std::size_t count = publisher.publish(messages_allowed(), messages_max_);
      if (count == 0) break;
      expected_ += count * recipients_a_message_;
      any = true;
    }
  }
  if (any) last_write_ = Clock::now();
  return any;
}

/// A message that comes after it was given up was late, not lost.
void Flood::settle(std::uint64_t count) {
  settled_ += count;
  if (settled_ + missing_ > expected_)
    missing_ -= std::min(missing_, settled_ + missing_ - expected_);
}

std::uint64_t Flood::turn(std::chrono::nanoseconds patience) {
  const bool any = publish();
  const std::uint64_t settled = engine_.poll(any ? std::chrono::nanoseconds(0) : patience);
  settle(settled);
  return settled;
}

void Flood::run_for(std::chrono::nanoseconds duration) {
  const auto deadline = Clock::now() + duration;
  auto last_settled = Clock::now();
  last_write_ = last_settled;
  while (Clock::now() < deadline) {
    const auto now = Clock::now();
    longest_pause_ = std::max(longest_pause_, now - last_write_);
    if (turn(kPatience) != 0) {
      last_settled = now;
    } else if (now - last_settled > engine_.patience()) {
      // Lost at the end of a stream: nothing after it would ever show the gap.
      missing_ = expected_ - settled_;
      last_settled = now;
    }
  }
}

void Flood::drain() {
  auto last_settled = Clock::now();
  while (expected_ > settled_ + missing_) {
    for (auto& publisher : publishers_) publisher.client().flush();
    const std::uint64_t settled = engine_.poll(kPatience);
    settle(settled);
    const auto now = Clock::now();
    if (settled != 0) last_settled = now;
    if (now - last_settled > engine_.patience()) missing_ = expected_ - settled_;
  }
}

}  // namespace gimnet::perf
