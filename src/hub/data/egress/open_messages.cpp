#include "hub/data/egress/open_messages.hpp"

#include <algorithm>
#include <array>

namespace gimnet::hub {

bool OpenMessages::follow(const Entry& fragment) {
  const proto::FragmentStream stream = proto::FragmentStream::of(fragment.run.header());
  const auto found = find(stream);
  const bool known = found != messages_.end();
  if (fragment.touched && (!known || found->number != fragment.message_number)) return false;
  // A beginning ends the stream's message before it, whatever became of that one.
  if (known && (fragment.complete || !fragment.touched)) messages_.erase(found);
  if (!fragment.complete && !fragment.touched) add({stream, fragment.message_number});
  return true;
}

void OpenMessages::forget(const Entry& fragments) {
  const auto open = find(proto::FragmentStream::of(fragments.run.header()));
  if (open != messages_.end() && open->number == fragments.message_number) messages_.erase(open);
}

std::vector<OpenMessages::Message>::iterator OpenMessages::find(
    const proto::FragmentStream& stream) {
  return std::ranges::find(messages_, stream, &Message::stream);
}

void OpenMessages::add(const Message& message) {
  if (messages_.size() == kMost) {
    std::array<proto::Holding, kMost> holdings;
    std::ranges::transform(messages_, holdings.begin(), [](const Message& each) -> proto::Holding {
      return {.src = each.stream.src, .amount = 1};
    });
    messages_.erase(messages_.begin() +
                    static_cast<std::ptrdiff_t>(proto::first_of_fullest_source(holdings)));
  }
  messages_.push_back(message);
}

}  // namespace gimnet::hub
