// Any bytes as a GIMI message: its parts lie within it, and come out the same after writing them.
// Input: a payload.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "fuzz/support/fuzz_input.hpp"
#include "proto/gimi/message_header.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::proto::gimi;
using Bytes = std::span<const std::byte>;

void check_rewritten(const MessageView& message) {
  std::array<std::byte, kMessagePrefixMax> prefix{};
  const std::size_t size = write_message_prefix(message.header, message.timestamp_ns, prefix);
  std::vector<std::byte> written(prefix.begin(),
                                 prefix.begin() + static_cast<std::ptrdiff_t>(size));
  written.insert(written.end(), message.data.begin(), message.data.end());
  const auto again = parse_message(written);
  FUZZ_MUST(again && again->header.sequence == message.header.sequence);
  FUZZ_MUST(again->header.operation == message.header.operation &&
            again->header.flags == message.header.flags);
  FUZZ_MUST(again->timestamp_ns == message.timestamp_ns && fuzz::same(again->data, message.data));
}

void check_data(const MessageView& message) {
  if (const auto ack = decode_ack(message.data)) {
    std::array<std::byte, kAckSizeMax> written{};
    const std::size_t size = encode_ack(*ack, written);
    FUZZ_MUST(fuzz::same(std::span(written).first(size), message.data.first(size)));
  }
  if (const auto failure = decode_error(message.data)) {
    const auto again = encode_error(*failure);
    // A group id of 0 may come, and is not written.
    const bool same = fuzz::same(std::span(again), message.data);
    FUZZ_MUST(same ||
              (failure->group == 0 && again.size() + sizeof failure->group == message.data.size()));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const fuzz::ExactCopy payload(fuzz::input(data, size));
  const auto message = parse_message(payload.span());
  if (!message) return 0;
  FUZZ_MUST(kMessageHeaderSize + message->extension.size() + message->data.size() == size);
  check_rewritten(*message);
  check_data(*message);
  return 0;
}
