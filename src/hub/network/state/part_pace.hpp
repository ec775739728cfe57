#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "hub/network/state/record_store.hpp"

namespace gimnet::hub {

/// Bounds how often one link may bring a part of a record: 20 times a second each. Of those that
/// come faster the newest waits. An honest hub sends its own changes no faster, so this bounds what
/// one that is not can make all others do. Thread safety: none. Time is an argument. Limits:
/// remembers the parts that came within the last pause.
class PartPace {
 public:
  static constexpr std::chrono::milliseconds kPause{50};

  /// True: take it now. False: it waits, or a newer one does.
  [[nodiscard]] bool admit(const PartRef& part, std::chrono::milliseconds now) {
    const auto [found, is_new] =
        heard_.try_emplace({part->said.hub, part->said.part}, Heard{now + kPause, nullptr});
    Heard& heard = found->second;
    if (is_new) return true;
    if (heard.waiting == nullptr && now >= heard.next) {
      heard.next = now + kPause;
      return true;
    }
    if (heard.waiting == nullptr || is_newer(part->said, heard.waiting->said)) heard.waiting = part;
    return false;
  }

  /// The parts that waited long enough.
  [[nodiscard]] std::vector<PartRef> take_due(std::chrono::milliseconds now) {
    std::vector<PartRef> due;
    for (auto entry = heard_.begin(); entry != heard_.end();) {
      Heard& heard = entry->second;
      if (now < heard.next) {
        ++entry;
      } else if (heard.waiting == nullptr) {
        entry = heard_.erase(entry);
      } else {
        due.push_back(std::exchange(heard.waiting, nullptr));
        heard.next = now + kPause;
        ++entry;
      }
    }
    return due;
  }
  /// Nothing: no part waits.
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_due() const {
    std::optional<std::chrono::milliseconds> due;
    for (const auto& [part, heard] : heard_) {
      if (heard.waiting != nullptr) due = std::min(due.value_or(heard.next), heard.next);
    }
    return due;
  }

 private:
  struct Heard {
    std::chrono::milliseconds next;
    PartRef waiting;
  };
  std::map<std::pair<proto::HubKey, std::uint16_t>, Heard> heard_;
};

}  // namespace gimnet::hub
