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
  place.wanted = message.reported();
  message.write_start(place.start);
}

std::optional<std::uint32_t> ReportedMessages::number_of(const proto::Report& report) {
  const proto::FrameHeader& header = report.header;
  if (!header.has(proto::kFlagFragment) || header.has(proto::kFlagExt) || header.kind == proto::Kind::list) {
    return std::nullopt;
  }
  if (report.following.size() < proto::kFragmentHeaderSize) return std::nullopt;
  return proto::load_fragment_header(report.following.data()).message;
}

// Reports are few, since a hub merges them: looking at all messages costs less than an index that each would keep.
const ReportedMessages::Message* ReportedMessages::find_message(const proto::Report& report) const {
  const auto number = number_of(report);
  if (!number || *number == 0) return nullptr;
  const auto found = std::ranges::find_if(messages_, [&](const Message& message) {
    return message.number == *number && message.dst == report.header.dst && message.kind == report.header.kind;
  });
  return found == messages_.end() ? nullptr : &*found;
}

std::optional<ReportedMessages::Start> ReportedMessages::find(const proto::Report& report) const {
  const Message* const found = find_message(report);
  if (found == nullptr) return std::nullopt;
  return found->start;
}

bool ReportedMessages::is_unwanted(const proto::Report& report) const {
  if (!report.header.has(proto::kFlagFragment)) return false;
  if (number_of(report)) {
    const Message* const found = find_message(report);
    return found != nullptr && !found->wanted;
  }
  bool any = false;
  for (const Message& message : messages_) {
    if (message.number == 0 || message.dst != report.header.dst || message.kind != report.header.kind) continue;
    if (message.wanted) return false;
    any = true;
  }
  return any;
}

}  // namespace gimnet::nif
