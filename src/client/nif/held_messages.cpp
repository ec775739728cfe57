#include "client/nif/held_messages.hpp"

#include <utility>

namespace gimnet::nif {

HeldMessage& HeldMessages::hold(Outgoing& message, const SendProgress& progress,
                                const proto::Fragmenter& fragmenter) {
  messages_.push_back({message.copy_rest(fragmenter.offset()), progress, fragmenter});
  bytes_ += bytes_of(messages_.back());
  return messages_.back();
}

HeldMessages::Place HeldMessages::erase(Place place) {
  bytes_ -= bytes_of(*place);
  return messages_.erase(place);
}

void HeldMessages::clear() {
  messages_.clear();
  bytes_ = 0;
}

std::optional<proto::Report> HeldMessages::report_of(std::uint32_t from,
                                                     const proto::Taken& taken) const {
  for (const HeldMessage& each : messages_) {
    const SendProgress& progress = each.progress;
    if (!taken.refuses() || progress.number != taken.message || progress.dst != from) continue;
    if (!progress.windowed || !each.message->reported()) continue;
    proto::Report report;
    // A receiver that took a part does not mind the size.
    report.reason = progress.window.taken() == 0 ? proto::DropReason::too_large
                                                 : proto::DropReason::cut_message;
    report.count = 1;
    report.header = each.message->parts().header;
    return report;
  }
  return std::nullopt;
}

}  // namespace gimnet::nif
