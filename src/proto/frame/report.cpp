#include "proto/frame/report.hpp"

#include <algorithm>
#include <cstring>

#include "base/endian.hpp"

namespace gimnet::proto {

std::optional<Report> decode_report(std::span<const std::byte> payload) {
  if (payload.size() < kReportSizeMin) return std::nullopt;
  Report report;
  const auto reason = static_cast<std::uint8_t>(payload[0]);
  if (reason < kDropReasonCount) report.reason = static_cast<DropReason>(reason);
  report.count = load_le<std::uint32_t>(payload.data() + 4);
  report.header = load_header(payload.data() + 8);
  const auto rest = payload.subspan(kReportSizeMin);
  report.following = rest.first(std::min(rest.size(), kReportFollowingMax));
  return report;
}

std::size_t encode_report(const Report& report, std::span<std::byte, kReportSizeMax> payload) {
  std::byte* bytes = payload.data();
  std::memset(bytes, 0, 4);
  bytes[0] = static_cast<std::byte>(report.reason);
  store_le(bytes + 4, report.count);
  store_header(bytes + 8, report.header);
  const std::size_t following = std::min(report.following.size(), kReportFollowingMax);
  if (following != 0) std::memcpy(bytes + kReportSizeMin, report.following.data(), following);
  return kReportSizeMin + following;
}

}  // namespace gimnet::proto
