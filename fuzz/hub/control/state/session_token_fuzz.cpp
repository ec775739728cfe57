#include "hub/control/state/session_token.hpp"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>

// A token as somebody shows it: nothing but the hub's own bytes is genuine. The input is shown as
// it is, and laid over a genuine token, bit by bit, so that the mutations begin close to one.

namespace {

using namespace gimnet::hub;

void require(bool condition) {
  if (!condition) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto input = std::as_bytes(std::span{data, size});
  const TokenHolder holder{gimnet::HubId{7}, "robot1/base", Identity::of_user(1000)};
  Secret secret;
  secret.fill(std::byte{0x42});
  const SessionToken said{gimnet::NodeIndex{17}, first_number(3) + 5,
                          std::chrono::milliseconds{1'700'000'000'000}};
  const std::vector<std::byte> genuine = write_token(said, holder, secret);
  require(read_token(genuine) == said && is_genuine(genuine, holder, secret));

  static_cast<void>(read_token(input));
  const bool same = std::equal(input.begin(), input.end(), genuine.begin(), genuine.end());
  require(is_genuine(input, holder, secret) == same);

  std::vector<std::byte> changed = genuine;
  for (std::size_t i = 0; i < std::min(changed.size(), input.size()); ++i) changed[i] ^= input[i];
  static_cast<void>(read_token(changed));
  require(is_genuine(changed, holder, secret) == (changed == genuine));
  return 0;
}
