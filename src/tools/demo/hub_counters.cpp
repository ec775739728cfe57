#include "tools/demo/hub_counters.hpp"

#include <fmt/format.h>

namespace gimnet::demo {
namespace {

constexpr std::string_view kDropPrefix = "dropped.";

}  // namespace

void HubCounters::add(std::string_view name, std::uint64_t value) {
  if (name == "accepted") {
    accepted += value;
  } else if (name == "copies") {
    copies += value;
  } else if (name == "delivered") {
    delivered += value;
  } else if (name == "queued") {
    queued += value;
  } else if (name.starts_with(kDropPrefix) && value != 0) {
    const std::string_view reason = name.substr(kDropPrefix.size());
    for (Drop& drop : drops) {
      if (drop.reason == reason) {
        drop.frames += value;
        return;
      }
    }
    drops.push_back({std::string(reason), value});
  }
}

std::uint64_t HubCounters::dropped() const {
  std::uint64_t sum = 0;
  for (const Drop& drop : drops) sum += drop.frames;
  return sum;
}

std::string HubCounters::drops_text() const {
  std::string text;
  for (const Drop& drop : drops)
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", drop.frames, drop.reason);
  return text.empty() ? "none" : text;
}

}  // namespace gimnet::demo
