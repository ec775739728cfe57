#include "client/nif/reported_messages.hpp"

#include <algorithm>

#include "proto/frame/fragment_header.hpp"

namespace gimnet::nif {

void ReportedMessages::remember(std::uint32_t number, Outgoing& message) {
  if (messages_.empty()) messages_.resize(kMessagesMax);
  Message& place = messages_[next_];
  next_ = (next_ + 1) % kMessagesMax;
  const proto::FrameHeader& header = message.parts().header;
  place.number = number;
  place.dst = header.dst;
  place.kind = header.kind;
  message.write_start(place.start);
}

std::optional<std::uint32_t> ReportedMessages::number_of(const proto::Report& report) {
  const proto::FrameHeader& header = report.header;
  if (!header.has(proto::kFlagFragment) || header.has(proto::kFlagExt) ||
      header.kind == proto::Kind::list) {
    return std::nullopt;
  }
  if (report.following.size() < proto::kFragmentHeaderSize) return std::nullopt;
  return proto::load_fragment_header(report.following.data()).message;
}

// Reports are few, since a hub merges them: looking at all messages costs less than an index that
// each would keep.
std::optional<ReportedMessages::Start> ReportedMessages::find(const proto::Report& report) const {
  const auto number = number_of(report);
  if (!number || *number == 0) return std::nullopt;
  const auto found = std::ranges::find_if(messages_, [&](const Message& message) {
    return message.number == *number && message.dst == report.header.dst &&
           message.kind == report.header.kind;
  });
  if (found == messages_.end()) return std::nullopt;
  return found->start;
}

}  // namespace gimnet::nif
