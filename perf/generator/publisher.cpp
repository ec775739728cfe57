#include "generator/publisher.hpp"

#include <algorithm>

namespace gimnet::perf {
namespace {

constexpr std::size_t kWriteBytes = 64 * 1024;

}  // namespace

Publisher::Publisher(Wire& wire, Client& from, const std::vector<Target>& targets,
                     MessageShape shape, Writing writing)
    : from_(from.publishing_side()), writing_(writing), messages_a_write_(1) {
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

}  // namespace gimnet::perf
