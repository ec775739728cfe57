#include "hub/control/state/hub_state.hpp"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>

// The file that a hub goes on from. The input is the file without its digest, which nobody could
// guess: whatever it holds is refused, or is what a hub writes, byte for byte.

namespace {

using namespace gimnet::hub;

void require(bool condition) {
  if (!condition) std::abort();
}

/// No newcomer of the next start gets what somebody may have, and what it gets is kept.
void check_indices(const IndexRange& range, const IndexSet& found, const IndexSet& kept) {
  constexpr std::uint32_t kMost = gimnet::kEveryIndex - 1;
  require(range.used == found &&
          kept.size() == found.size() + std::min(IndexPool::kBlock, kMost - found.size()));
  std::uint32_t unused = 0;
  for (std::uint64_t i = 0; i < range.count; ++i) {
    const auto index = static_cast<std::uint32_t>((range.first - 1 + i) % kMost) + 1;
    if (!found.contains(index)) ++unused;
    require(kept.contains(index));
  }
  require(unused == kept.size() - found.size());
}

/// The indices from `first` on that the next start may hand out.
IndexSet block_from(std::uint32_t first) {
  IndexSet block;
  for (std::uint32_t i = 0; i < IndexPool::kBlock; ++i)
    block.insert((first - 1 + i) % (gimnet::kEveryIndex - 1) + 1);
  return block;
}

void check(std::span<const std::byte> file) {
  const auto state = read_hub_state(file);
  if (!state) {
    require(!state.error().sentence.empty());
    return;
  }
  const auto start = next_start(*state, std::chrono::milliseconds{0});
  if (start) {
    require(start->state.boot == state->boot + 1);
    check_indices(start->nodes, state->nodes_used, start->state.nodes_used);
    check_indices(start->groups, {}, block_from(state->group_mark));
    require(read_hub_state(write_hub_state(start->state)).has_value());
  }
  require(std::ranges::equal(write_hub_state(*state), file));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto input = std::as_bytes(std::span{data, size});
  check(input);
  std::vector<std::byte> file(input.begin(), input.end());
  const Digest digest = sha256(file);
  file.insert(file.end(), digest.begin(), digest.end());
  check(file);
  return 0;
}
