#include "hub/control/handle/request.hpp"

#include <algorithm>

#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {
namespace {
/// For the answer's status and what else stands beside the records.
constexpr std::size_t kBesideRecords = 64;
}  // namespace

std::optional<proto::Refusal> count_declaration(HandlerContext& context, const Session& session) {
  const Limits& limits = context.limits;
  // All that a node may have it may also declare at once: it does after a restart of the hub.
  const std::uint64_t burst =
      std::max(limits.declarations_burst, limits.services_per_node + limits.subscriptions_per_node);
  const NodeIndex account = session.index;
  Session& counted = *context.membership.sessions().find(account);
  if (counted.declarations.take({limits.declarations_per_s, burst}, context.now))
    return std::nullopt;
  constexpr proto::Status kStatus = proto::Status::rate;
  return proto::Refusal{
      kStatus,
      "this node began or changed more names, services and subscriptions than it may: " +
          std::to_string(burst) + " at once and " + std::to_string(limits.declarations_per_s) +
          " a second; go slower, or start the hub with a larger --limit declarations_per_s"};
}

PageBudget::PageBudget(const Limits& limits, std::uint32_t records_wanted)
    : records_(std::clamp<std::size_t>(records_wanted, 1, limits.page_records)),
      bytes_(std::min<std::size_t>(limits.frame_bytes, proto::kFrameLengthDefault) -
             kBesideRecords) {}

bool PageBudget::take(std::size_t bytes) {
  if (records_ == 0 || bytes > bytes_) return false;
  --records_;
  bytes_ -= bytes;
  return true;
}

}  // namespace gimnet::hub
