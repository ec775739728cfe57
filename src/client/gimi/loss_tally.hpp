#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "gimnet/gimi/node_state.hpp"
#include "gimnet/gimi/outcome.hpp"
#include "gimnet/nif_status.h"
#include "proto/frame/frame_header.hpp"

namespace gimnet::gimi {

/// Why messages were lost, or may be: for programs, and for people. By itself: they are not.
struct Loss {
  LossReason reason = LossReason::none;
  std::string words;
  [[nodiscard]] explicit operator bool() const { return !words.empty(); }
};

/// The words of a hub's report for people: the reason's name, and its meaning if the name does not
/// tell it.
[[nodiscard]] inline std::string report_words(std::string_view reason) {
  using Meaning = std::pair<std::string_view, std::string_view>;
  constexpr std::array<Meaning, 13> kMeanings{
      Meaning{"no_such_node", "no node has that id"},
      Meaning{"no_such_group", "that service was withdrawn"},
      Meaning{"no_route", "no hub of that id can be reached"},
      Meaning{"away", "its connection broke, and it has not come back yet"},
      Meaning{"queue_full", "it does not read as fast as is sent"},
      Meaning{"over_budget", "the hub's memory for what waits is used up, or its share of it"},
      Meaning{"timed_out", "it took nothing for as long as the hub waits"},
      Meaning{"cut_message", "an earlier part of it was dropped"},
      Meaning{"renumbered", "that node has another id now: ask for it by its name"},
      Meaning{"link_lost", "a connection on the way broke, and it did not arrive"},
      Meaning{"link_unsure", "a connection on the way broke, and it may have arrived"},
      Meaning{"hop_limit", "the ways between hubs were changing; try again"},
      Meaning{"not_allowed",
              "a link between hubs may not carry it: see `allow` in their configuration"},
  };
  std::string words = "the hub reports " + std::string(reason);
  for (const auto& [name, meaning] : kMeanings) {
    if (name == reason) words += ": " + std::string(meaning);
  }
  return words;
}

/// The loss that a hub's report of that reason tells; `name` is the reason's.
[[nodiscard]] inline Loss reported_loss(std::uint32_t reason, std::string_view name) {
  return {reason < 64 ? static_cast<LossReason>(reason) : LossReason::none, report_words(name)};
}

/// The status of a call whose frame a hub dropped for that reason.
[[nodiscard]] inline Status dropped_status(std::uint32_t reason) {
  return reason == NIF_DROP_NOT_ALLOWED ? Status::denied : Status::not_delivered;
}

/// Counts messages that were lost on their way to this node, by reason. Frames that NIF could not
/// read are counted there. Thread safety: add_*() from the library's thread, counts() from any.
class LossTally {
 public:
  /// `count` as NIF_GAP has it: messages, or frames that went with a connection.
  void add(proto::DropReason reason, std::uint64_t count) { add(place(reason), count); }
  /// The hub dropped `frames` since this node's queue was full, mostly of what `source` had sent.
  void add_queue_full(std::uint32_t source, std::uint64_t frames) {
    add(queue_full_, frames);
    queue_filled_by_.store(source, std::memory_order_relaxed);  // as add()
  }
  /// The hub dropped `frames` since its memory for what waits was short.
  void add_over_budget(std::uint64_t frames) { add(over_budget_, frames); }
  /// A message of a group that no subscription of this node has.
  void add_unknown_service() { add(unknown_service_, 1); }
  /// A KEYED message without a GIMI header.
  void add_unreadable() { add(unreadable_, 1); }
  /// A message of a stream that its sender has begun anew since.
  void add_outdated() { add(outdated_, 1); }

  [[nodiscard]] LostCounts counts() const {
    // relaxed: see add()
    return {incomplete_.load(std::memory_order_relaxed),
            too_large_.load(std::memory_order_relaxed),  // see add()
            frames_broken_off_.load(std::memory_order_relaxed),
            unknown_service_.load(std::memory_order_relaxed),
            unreadable_.load(std::memory_order_relaxed),  // see add()
            outdated_.load(std::memory_order_relaxed),
            queue_full_.load(std::memory_order_relaxed),  // see add()
            Peer{queue_filled_by_.load(std::memory_order_relaxed)},
            over_budget_.load(std::memory_order_relaxed)};
  }

 private:
  using Count = std::atomic<std::uint64_t>;
  /// One thread writes; who reads wants a recent value, and nothing that goes with it.
  static void add(Count& sum, std::uint64_t count) {
    sum.store(sum.load(std::memory_order_relaxed) + count, std::memory_order_relaxed);
  }
  [[nodiscard]] Count& place(proto::DropReason reason) {
    if (reason == proto::DropReason::cut_message) return incomplete_;
    if (reason == proto::DropReason::no_subscriber) return unknown_service_;  // dropped by NIF
    return reason == proto::DropReason::too_large ? too_large_ : frames_broken_off_;
  }

  Count incomplete_{0};
  Count too_large_{0};
  Count frames_broken_off_{0};
  Count unknown_service_{0};
  Count unreadable_{0};
  Count outdated_{0};
  Count queue_full_{0};
  std::atomic<std::uint32_t> queue_filled_by_{0};
  Count over_budget_{0};
};

}  // namespace gimnet::gimi
