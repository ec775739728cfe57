// Any bytes as the opening and as the payload of a LINK frame (HELLO, WELCOME, GOODBYE). Input: a
// payload.

#include <cstddef>
#include <cstdint>
#include <span>

#include "fuzz/support/control_round_trip.hpp"
#include "proto/bitestream/reader.hpp"
#include "proto/control/link.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::proto;
using Bytes = std::span<const std::byte>;

/// An opening that is refused early is refused at every later byte too; 8 bytes are enough to
/// decide.
void check_opening_in_pieces(Bytes bytes) {
  auto result = Opening::need_more;
  for (std::size_t size = 0; size <= bytes.size() && size <= 2 * kOpeningSize; ++size) {
    const auto next = check_opening(bytes.first(size));
    FUZZ_MUST(result == Opening::need_more || next == result);
    FUZZ_MUST(size < kOpeningSize || next != Opening::need_more);
    result = next;
  }
}

/// Repeated keys count once, and the first one counts.
void check_name(Bytes payload) {
  const auto hello = decode<Hello>(payload);
  if (!hello) return;
  const auto name = bitestream::Reader(payload.subspan(kControlHeaderSize)).find(2);
  FUZZ_MUST(hello->name == (name ? name->as_text().value_or("?") : ""));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const fuzz::ExactCopy payload(fuzz::input(data, size));
  check_opening_in_pieces(payload.span());
  fuzz::check_message<Hello>(payload.span());
  fuzz::check_message<Welcome>(payload.span());
  fuzz::check_message<Goodbye>(payload.span());
  check_name(payload.span());
  return 0;
}
