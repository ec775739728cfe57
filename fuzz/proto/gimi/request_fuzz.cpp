// Any bytes as the data of a REQUEST and of its ERROR: the parts lie within them, and come out the
// same after writing them. Input: the data behind the GIMI header.

#include <cstddef>
#include <cstdint>
#include <span>

#include "fuzz/support/fuzz_input.hpp"
#include "proto/gimi/request.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace gimnet;
  using namespace gimnet::proto::gimi;
  const fuzz::ExactCopy payload(fuzz::input(data, size));
  const auto request = decode_request(payload.span());
  FUZZ_MUST(request.has_value() == (size >= kRequestPrefix));
  if (request) FUZZ_MUST(fuzz::same(request->data, payload.span().subspan(kRequestPrefix)));
  if (const auto error = decode_request_error(payload.span())) {
    const auto again = encode_request_error(*error);
    FUZZ_MUST(fuzz::same(std::span(again), payload.span()));
  }
  return 0;
}
