#include "client/gimi/received_streams.hpp"

#include <algorithm>
#include <iterator>

namespace gimnet::gimi {

StreamEpochs::Step StreamEpochs::look(std::uint32_t epoch) const {
  if (!any_) return Step::first;
  if (epoch == current_) return Step::goes_on;
  const auto end = former_.begin() + formers_;
  return std::find(former_.begin(), end, epoch) == end ? Step::begins : Step::former;
}

void StreamEpochs::take(std::uint32_t epoch) {
  if (any_ && epoch != current_) {
    former_[oldest_] = current_;
    oldest_ = static_cast<std::uint8_t>((oldest_ + 1) % kFormerMax);
    formers_ = static_cast<std::uint8_t>(std::min<std::size_t>(formers_ + 1u, kFormerMax));
  }
  current_ = epoch;
  any_ = true;
}

StreamEpochs& ReceivedStreams::find(const ReceivedStreamName& name) {
  const auto place = streams_.lower_bound(name);
  if (place != streams_.end() && place->first == name) return place->second;
  if (streams_.size() >= kStreamsMax)
    streams_.erase(place != streams_.begin() ? std::prev(place) : place);
  return streams_[name];
}

}  // namespace gimnet::gimi
