#include "generator/flood.hpp"

#include <algorithm>
#include <utility>

namespace gimnet::perf {
namespace {

constexpr std::size_t kWindowBytes = 2 * 1024 * 1024;
constexpr std::size_t kWindowBytesARecipient = 128 * 1024;
constexpr std::size_t kUnbatchedMessagesARecipient = 64;
/// Writes of a publisher in one turn where each is a single message.
constexpr std::size_t kUnbatchedWrites = 8;
constexpr std::chrono::seconds kDrainLimit{2};
constexpr std::chrono::milliseconds kPatience{1};

}  // namespace

Flood::Flood(Engine& engine, std::vector<Publisher> publishers, std::size_t recipients_a_message, double bytes_a_second)
    : engine_(engine),
      publishers_(std::move(publishers)),
      recipients_a_message_(recipients_a_message),
      bytes_a_second_(bytes_a_second),
      message_bytes_(publishers_.front().message_bytes()),
      window_bytes_(std::max(kWindowBytes, kWindowBytesARecipient * recipients_a_message)),
      is_unbatched_(publishers_.front().is_unbatched()),
      begin_(Clock::now()) {}

std::uint64_t Flood::deliveries_allowed() const {
  // Not more than has arrived so far: what a slow subject still has to do when time is up would take longer than the
  // run.
  std::uint64_t window = std::min<std::uint64_t>(window_bytes_ / message_bytes_, settled_ + missing_);
  if (is_unbatched_) window = std::min<std::uint64_t>(window, kUnbatchedMessagesARecipient * recipients_a_message_);
  const std::uint64_t under_way = expected_ - settled_ - missing_;
  return under_way >= window ? 0 : window - under_way;
}

bool Flood::publish() {
  bool any = false;
  for (auto& publisher : publishers_) {
    const std::size_t writes = is_unbatched_ ? kUnbatchedWrites : 1;
    for (std::size_t write = 0; write < writes; ++write) {
      if (bytes_a_second_ > 0) {
        const std::chrono::duration<double> elapsed = Clock::now() - begin_;
        if (static_cast<double>(begun_bytes_) > elapsed.count() * bytes_a_second_) break;
      }
      // A message larger than the window could not start otherwise.
      const std::uint64_t room = std::max<std::uint64_t>(deliveries_allowed() / recipients_a_message_,
                                                         expected_ == settled_ + missing_ ? UINT64_MAX : 0);
      const std::size_t count = publisher.publish(room);
      if (count == 0) break;
      begun_bytes_ += count * message_bytes_;
      expected_ += count * recipients_a_message_;
      any = true;
    }
  }
  return any;
}

std::uint64_t Flood::turn(std::chrono::nanoseconds patience) {
  const bool any = publish();
  const std::uint64_t settled = engine_.poll(any ? std::chrono::nanoseconds(0) : patience);
  settled_ += settled;
  return settled;
}

void Flood::run_for(std::chrono::nanoseconds duration) {
  const auto deadline = Clock::now() + duration;
  auto last_settled = Clock::now();
  while (Clock::now() < deadline) {
    const auto now = Clock::now();
    if (turn(kPatience) != 0) {
      last_settled = now;
    } else if (now - last_settled > kDrainLimit) {
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
    settled_ += settled;
    const auto now = Clock::now();
    if (settled != 0) last_settled = now;
    if (now - last_settled > kDrainLimit) missing_ = expected_ - settled_;
  }
}

}  // namespace gimnet::perf
