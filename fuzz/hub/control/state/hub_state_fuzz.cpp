#include "hub/control/state/hub_state.hpp"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>

// The file that a hub goes on from. The input is the file without its digest, which nobody could guess: whatever it
// holds is refused, or is what a hub writes, byte for byte.

namespace {

using namespace gimnet::hub;

void require(bool condition) {
  if (!condition) std::abort();
}

void check(std::span<const std::byte> file) {
  const auto state = read_hub_state(file);
  if (!state) {
    require(!state.error().sentence.empty());
    return;
  }
  const auto start = next_start(*state, std::chrono::milliseconds{0});
  if (start) {
    require(start->state.boot == state->boot + 1 && start->state.node_mark != state->node_mark);
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
