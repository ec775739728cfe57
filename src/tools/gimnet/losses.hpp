#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "gimnet/gimi.hpp"

namespace gimnet::tool {

/// When to say on standard error what goes on happening. Times are those of steady_now_ns(). Thread
/// safety: one thread.
class NewsPace {
 public:
  /// The shortest time between two words about it.
  static constexpr std::int64_t kPeriodNs = 1'000'000'000;

  /// There is something to say: now? If so, not again for kPeriodNs.
  [[nodiscard]] bool due(std::int64_t now_ns) {
    if (now_ns < next_ns_) return false;
    next_ns_ = now_ns + kPeriodNs;
    return true;
  }

 private:
  std::int64_t next_ns_ = 0;
};

/// Why messages to `target` were lost, as a stream says it: of a node that was called by its name,
/// no_such_node means that it has left, not that an id is wrong. REQUIRES: that name was found
/// before.
[[nodiscard]] std::string loss_words(const SendCounts& counts, const std::string& target);

/// Why messages did not come: the hub's memory, whoever filled it.
inline constexpr std::string_view kMemoryShort =
    "the hub's memory for what waits was short (`gimnet ctl connections` shows for whom it waits)";

/// Why messages did not come: a full queue, and who filled it, if that is known.
[[nodiscard]] std::string queue_full_words(std::string_view whose, const Peer& filled_by);

/// Messages lost on their way to this node, and when to say so. Thread safety: one thread.
class LostMessages {
 public:
  /// As the node counts them now.
  void take(const LostCounts& counts) { counts_ = counts; }
  [[nodiscard]] std::uint64_t all() const { return counts_.all(); }

  /// Sentences about what was not told yet, one a reason; none within NewsPace::kPeriodNs of the
  /// last ones.
  [[nodiscard]] std::vector<std::string> news(std::int64_t now_ns);
  /// As news(), at the end: whatever the time is.
  [[nodiscard]] std::vector<std::string> rest();

 private:
  LostCounts counts_;
  LostCounts told_;
  NewsPace pace_;
};

/// Messages of services that did not come, by the gaps between numbers, why, and when to say
/// so. Times are those of steady_now_ns(). Thread safety: one thread.
class MissedMessages {
 public:
  /// Was the service subscribed to later than it began? As MatchingServices::take_lateness().
  using TakeLateness = std::function<bool(std::string_view)>;

  explicit MissedMessages(TakeLateness take_lateness = {})
      : take_lateness_(std::move(take_lateness)) {}

  /// Returns how many of its service did not come up to this one. REQUIRES: it is of a service.
  std::uint64_t take(const Message& message);
  /// Number of those that were skipped for newer ones (Delivery::latest).
  [[nodiscard]] std::uint64_t skipped(std::string_view service) const;
  /// As the node counts now what it cannot give out. So many of what did not come since the last
  /// time count as missed, but are told by LostMessages. REQUIRES: the node receives nothing but
  /// these services.
  void take_lost(const LostCounts& counts);
  /// Sentences about what was not told yet, one a service and cause; none within
  /// NewsPace::kPeriodNs of the last ones.
  [[nodiscard]] std::vector<std::string> news(std::int64_t now_ns);
  /// As news(), at the end: whatever the time is.
  [[nodiscard]] std::vector<std::string> rest();

 private:
  struct Count {
    std::uint64_t missed = 0;
    std::uint64_t told = 0;
  };
  /// Frames of all services that the hub dropped for one reason, as one service looks at them.
  struct DropNews {
    std::uint64_t known = 0;        ///< as take_lost() had told at its last gap
    std::uint64_t unexplained = 0;  ///< of these frames, those that no gap has explained yet
    void look(std::uint64_t told) { unexplained += told - std::exchange(known, told); }
    void explain(std::uint64_t missed) { unexplained -= std::min(unexplained, missed); }
  };
  struct Service {
    std::uint32_t provider = 0;
    std::uint32_t sequence = 0;
    std::uint32_t reconnects = 0;
    DropNews queue_full;
    DropNews over_budget;
    std::int64_t gap_ns = 0;  ///< when the last message came that was behind a gap told of
    std::uint64_t missed = 0;
    Count early;     ///< before it was subscribed to
    Count broken;    ///< while the connection to the hub was
    Count skipped;   ///< of Delivery::latest: for newer ones
    Count slow;      ///< the queue at the hub was full, mostly of what its provider sent
    Count flooded;   ///< the same, of what another node sent
    Count squeezed;  ///< the hub's memory for what waits was short
    Count unknown;   ///< by all that happens elsewhere
  };
  /// The longest time between two gaps of one full queue: behind it, frames without a gap were
  /// other messages.
  static constexpr std::int64_t kOneFloodNs = 5'000'000'000;
  /// A message that is so many numbers behind is of a provider that began again. Nearer ones came
  /// late, as they do while ways between hubs change (the library knows as many numbers).
  static constexpr std::int32_t kLateMost = 64;

  static void add_sentence(std::vector<std::string>& sentences, Count& count,
                           const std::string& service, std::string_view what);
  Count& cause_of(Service& service, std::uint64_t missed, const Message& message);
  void count(Service& service, std::uint64_t missed, const Message& message);

  const TakeLateness take_lateness_;
  std::map<std::string, Service, std::less<>> services_;
  NewsPace pace_;
  std::uint64_t lost_ = 0;          ///< as take_lost() was told last
  std::uint64_t told_as_lost_ = 0;  ///< of those that did not come yet in numbers
  std::uint64_t queue_full_ = 0;    ///< as take_lost() was told last
  std::uint64_t over_budget_ = 0;   ///< the same
  Peer queue_filled_by_;
  Peer flooder_;  ///< the last one that made somebody miss something
  bool untold_ = false;
};

}  // namespace gimnet::tool
