#include "hub/control/handle/request.hpp"

#include <algorithm>

#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {
namespace {
/// For the answer's status and what else stands beside the records.
constexpr std::size_t kBesideRecords = 64;
}  // namespace

PageBudget::PageBudget(const Limits& limits, std::uint32_t records_wanted)
    : records_(std::clamp<std::size_t>(records_wanted, 1, limits.page_records)),
      bytes_(std::min<std::size_t>(limits.frame_bytes, proto::kFrameLengthDefault) - kBesideRecords) {}

bool PageBudget::take(std::size_t bytes) {
  if (records_ == 0 || bytes > bytes_) return false;
  --records_;
  bytes_ -= bytes;
  return true;
}

}  // namespace gimnet::hub
