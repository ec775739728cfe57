// Any sequence of fragments: the messages that come out are those that a naive receiver gets, lost
// ones are counted the same, and no limit is ever passed. Input: 5 bytes a fragment {stream,
// message, offset, total, size}.

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "fuzz/support/fuzz_input.hpp"
#include "proto/frame/reassembler.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::proto;
using State = Reassembled::State;

constexpr std::uint32_t kMessageMax = 48;
constexpr std::uint32_t kStreams = 6;

struct Step {
  std::uint32_t stream;
  FragmentHeader fragment;
  std::vector<std::byte> payload;
};

/// The byte at an offset of a message. It differs by offset, so that a byte in a wrong place is
/// seen.
std::byte content(std::uint32_t stream, std::uint32_t message, std::uint32_t offset) {
  return static_cast<std::byte>(31 * stream + 7 * message + offset);
}

FragmentStream stream_of(std::uint32_t number) {
  return {1 + number % 3, 2, number < 3 ? Kind::unicast : Kind::service, 1};
}

Step read_step(fuzz::Choices& choices) {
  Step step{choices.below(kStreams), {}, {}};
  step.fragment.message = choices.below(8);
  step.fragment.offset = choices.below(64);
  step.fragment.total = step.fragment.offset + choices.below(64);
  const std::uint32_t room = step.fragment.total - step.fragment.offset;
  if (room == 0) step.fragment.total += 1;
  const std::uint32_t size = 1 + choices.byte() % std::max(room, 1u);
  for (std::uint32_t i = 0; i < size; ++i) {
    step.payload.push_back(content(step.stream, step.fragment.message, step.fragment.offset + i));
  }
  return step;
}

/// Without limits on streams and bytes, and with all of history at hand.
class NaiveReceiver {
 public:
  std::optional<std::vector<std::byte>> take(const Step& step) {
    auto& open = open_[step.stream];
    const FragmentHeader& fragment = step.fragment;
    if (open && open->message == fragment.message) {
      if (fragment.offset != open->bytes.size() || fragment.total != open->total) {
        lose(step.stream, fragment.message);
        return std::nullopt;
      }
    } else {
      if (open) lose(step.stream, open->message);
      if (fragment.offset != 0 || fragment.total > kMessageMax) {
        lose(step.stream, fragment.message);
        return std::nullopt;
      }
      open = Open{fragment.message, fragment.total, {}};
    }
    open->bytes.insert(open->bytes.end(), step.payload.begin(), step.payload.end());
    if (open->bytes.size() < open->total) return std::nullopt;
    auto whole = std::move(open->bytes);
    open.reset();
    return whole;
  }
  [[nodiscard]] std::uint64_t lost() const { return lost_; }

 private:
  struct Open {
    std::uint32_t message;
    std::uint32_t total;
    std::vector<std::byte> bytes;
  };
  void lose(std::uint32_t stream, std::uint32_t message) {
    open_[stream].reset();
    const auto last = last_lost_.find(stream);
    if (last != last_lost_.end() && last->second == message) return;
    last_lost_[stream] = message;
    ++lost_;
  }
  std::map<std::uint32_t, std::optional<Open>> open_;
  std::map<std::uint32_t, std::uint32_t> last_lost_;
  std::uint64_t lost_ = 0;
};

void check_against_naive(const std::vector<Step>& steps) {
  Reassembler reassembler({.message_bytes_max = kMessageMax});
  NaiveReceiver naive;
  for (const Step& step : steps) {
    const fuzz::ExactCopy payload(step.payload);
    const auto expected = naive.take(step);
    const auto result = reassembler.take(stream_of(step.stream), step.fragment, payload.span());
    FUZZ_MUST((result.state == State::whole) == expected.has_value());
    FUZZ_MUST(!expected || fuzz::same(result.message, *expected));
    FUZZ_MUST(reassembler.lost_messages() == naive.lost());
  }
}

void check_limits(const std::vector<Step>& steps) {
  const ReassemblyLimits limits{
      .message_bytes_max = kMessageMax, .waiting_bytes_max = 64, .streams_max = 3};
  Reassembler reassembler(limits);
  std::uint64_t lost = 0;
  for (const Step& step : steps) {
    const auto result = reassembler.take(stream_of(step.stream), step.fragment, step.payload);
    lost += result.lost_messages + result.displaced.size();
    FUZZ_MUST(reassembler.waiting_bytes() <= limits.waiting_bytes_max);
    FUZZ_MUST(reassembler.open_messages() <= limits.streams_max);
    FUZZ_MUST(reassembler.lost_messages() == lost);
    if (result.state != State::whole) continue;
    FUZZ_MUST(result.message.size() == step.fragment.total && step.fragment.total <= kMessageMax);
    for (std::uint32_t i = 0; i < result.message.size(); ++i) {
      FUZZ_MUST(result.message[i] == content(step.stream, step.fragment.message, i));
    }
  }
  reassembler.forget(NodeId{1});
  reassembler.clear();
  FUZZ_MUST(reassembler.waiting_bytes() == 0 && reassembler.open_messages() == 0);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Choices choices(fuzz::input(data, size));
  std::vector<Step> steps;
  while (choices.left() && steps.size() < 400) steps.push_back(read_step(choices));
  check_against_naive(steps);
  check_limits(steps);
  return 0;
}
