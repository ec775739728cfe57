#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "gimnet/gimi/outcome.hpp"

namespace gimnet::gimi {

/// Why messages were lost, or may be: for programs, and for people. By itself: they are not.
struct Loss {
  LossReason reason = LossReason::none;
  std::string words;
  [[nodiscard]] explicit operator bool() const { return !words.empty(); }
};

/// What a hub's report says to people: the reason's name, and what it means where the name does not
/// tell.
[[nodiscard]] inline std::string report_words(std::string_view reason) {
  using Meaning = std::pair<std::string_view, std::string_view>;
  constexpr std::array<Meaning, 9> kMeanings{
      Meaning{"no_such_node", "no node has that id"},
      Meaning{"no_such_group", "that service was withdrawn"},
      Meaning{"no_route", "no hub of that id can be reached"},
      Meaning{"away", "its connection broke, and it has not come back yet"},
      Meaning{"queue_full", "it does not read as fast as is sent"},
      Meaning{"over_budget", "the hub's memory for what waits is used up, or its share of it"},
      Meaning{"timed_out", "it took nothing for as long as the hub waits"},
      Meaning{"cut_message", "an earlier part of it was dropped"},
      Meaning{"renumbered", "that node has another id now: ask for it by its name"},
  };
  std::string words = "the hub reports " + std::string(reason);
  for (const auto& [name, meaning] : kMeanings) {
    if (name == reason) words += ": " + std::string(meaning);
  }
  return words;
}

/// What a hub's report of that reason, which has that name, says.
[[nodiscard]] inline Loss reported_loss(std::uint32_t reason, std::string_view name) {
  return {reason < 64 ? static_cast<LossReason>(reason) : LossReason::none, report_words(name)};
}

}  // namespace gimnet::gimi
