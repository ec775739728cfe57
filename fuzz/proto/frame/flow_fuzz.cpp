// Any bytes as the payload of FLOW, REPORT and TAKEN: what is read comes out the same after writing
// it. Input: a payload.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "fuzz/support/fuzz_input.hpp"
#include "proto/frame/flow.hpp"
#include "proto/frame/report.hpp"
#include "proto/frame/taken.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::proto;
using Bytes = std::span<const std::byte>;

void check_flow(Bytes payload) {
  const auto message = flow::decode(payload);
  if (!message) return;
  std::array<std::byte, flow::kSizeMax> written{};
  const std::size_t size = flow::encode(*message, written);
  FUZZ_MUST(size <= payload.size());
  FUZZ_MUST(flow::decode(std::span(written).first(size)) == message);
}

void check_report(Bytes payload) {
  const auto report = decode_report(payload);
  if (!report) return;
  std::array<std::byte, kReportSizeMax> written{};
  const std::size_t size = encode_report(*report, written);
  const auto again = decode_report(std::span(written).first(size));
  FUZZ_MUST(again && again->reason == report->reason && again->count == report->count);
  FUZZ_MUST(again->header == report->header && fuzz::same(again->following, report->following));
}

void check_taken(Bytes payload) {
  const auto taken = decode_taken(payload);
  if (!taken) return;
  std::array<std::byte, kTakenSize> written{};
  encode_taken(*taken, written);
  FUZZ_MUST(fuzz::same(written, payload.first(kTakenSize)));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const fuzz::ExactCopy payload(fuzz::input(data, size));
  check_flow(payload.span());
  check_report(payload.span());
  check_taken(payload.span());
  return 0;
}
