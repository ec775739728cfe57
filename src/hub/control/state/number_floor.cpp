#include "hub/control/state/number_floor.hpp"

#include <algorithm>

namespace gimnet::hub {

SessionNumber NumberFloor::at(NodeIndex index) const {
  const std::size_t page = index.value() / kPage;
  if (page >= pages_.size() || pages_[page] == nullptr) return 0;
  return (*pages_[page])[index.value() % kPage];
}

void NumberFloor::raise(NodeIndex index, SessionNumber number) {
  const std::size_t page = index.value() / kPage;
  if (page >= pages_.size()) pages_.resize(page + 1);
  if (pages_[page] == nullptr) pages_[page] = std::make_unique<Page>();
  SessionNumber& floor = (*pages_[page])[index.value() % kPage];
  floor = std::max(floor, number);
}

}  // namespace gimnet::hub
