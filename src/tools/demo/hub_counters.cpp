#include "tools/demo/hub_counters.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace gimnet::demo {
namespace {

constexpr std::string_view kDropPrefix = "dropped.";

}  // namespace

void HubCounters::add(std::string_view name, std::uint64_t value) {
  if (name == "accepted") accepted += value;
  if (name == "copies") copies += value;
  if (name == "delivered") delivered += value;
  if (name == "queued") queued += value;
  if (!name.starts_with(kDropPrefix) || value == 0) return;
  const std::string_view reason = name.substr(kDropPrefix.size());
  const auto known = std::ranges::find(drops, reason, &Drop::reason);
  if (known == drops.end()) {
    drops.push_back({std::string(reason), value});
  } else {
    known->frames += value;
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
