#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "base/mutex.hpp"
#include "client/nif/credit_book.hpp"
#include "client/nif/declarations.hpp"
#include "client/nif/hub_clock.hpp"
#include "client/nif/node_status.hpp"
#include "client/nif/options.hpp"
#include "client/nif/outbound.hpp"
#include "client/nif/receive_queue.hpp"
#include "client/nif/record_list.hpp"
#include "client/nif/request_table.hpp"
#include "client/nif/watch_table.hpp"

namespace gimnet::nif {

/// Which id a name had a moment ago, and which name an id. An entry holds for a second, or until it
/// is known to be wrong. Thread safety: any thread; the time is the caller's. Limits: kEntriesMax,
/// then everything is forgotten.
class NameCache {
 public:
  static constexpr std::size_t kEntriesMax = 4096;
  static constexpr std::int64_t kHoldsNs = 1'000'000'000;

  void remember(std::string_view name, std::uint32_t id, std::int64_t now_ns)
      GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    if (by_name_.size() >= kEntriesMax || by_id_.size() >= kEntriesMax) clear_locked();
    if (!name.empty())
      by_name_.insert_or_assign(std::string(name), Entry<std::uint32_t>{id, now_ns});
    by_id_.insert_or_assign(id, Entry<std::string>{std::string(name), now_ns});
  }
  [[nodiscard]] std::optional<std::uint32_t> id_of(std::string_view name, std::int64_t now_ns)
      GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    const auto found = by_name_.find(name);
    if (found == by_name_.end() || now_ns - found->second.since_ns > kHoldsNs) return std::nullopt;
    return found->second.value;
  }
  [[nodiscard]] std::optional<std::string> name_of(std::uint32_t id, std::int64_t now_ns)
      GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    const auto found = by_id_.find(id);
    if (found == by_id_.end() || now_ns - found->second.since_ns > kHoldsNs) return std::nullopt;
    return found->second.value;
  }
  /// The node is gone, or has another id.
  void forget(std::uint32_t id) GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    by_id_.erase(id);
    std::erase_if(by_name_, [id](const auto& entry) { return entry.second.value == id; });
  }
  void clear() GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    clear_locked();
  }

 private:
  template <class Value>
  struct Entry {
    Value value;
    std::int64_t since_ns = 0;
  };
  void clear_locked() GIMNET_REQUIRES(mutex_) {
    by_name_.clear();
    by_id_.clear();
  }

  Mutex mutex_;
  std::map<std::string, Entry<std::uint32_t>, std::less<>> by_name_ GIMNET_GUARDED_BY(mutex_);
  std::map<std::uint32_t, Entry<std::string>> by_id_ GIMNET_GUARDED_BY(mutex_);
};

/// The parts of a node that its library thread and the program's threads share. Thread safety: as
/// each part says.
struct NodeParts {
  explicit NodeParts(Options given)
      : options(std::move(given)),
        outbound(options.send, wake, options.last_message_bytes),
        received(options.receive_queue_bytes, wake),
        requests(outbound),
        credits(outbound),
        declarations(requests, outbound, credits),
        watches(requests) {}

  void push_event(Record* event) {
    event->incoming.arrival_ns = wall_now_ns();
    const Item item = item_of(event, event->text.size());
    received.push(std::span(&item, 1));
  }

  const Options options;
  net::WakeSignal wake;  ///< there is work for the library's thread
  net::WakeSignal stop;  ///< ends a dial
  Outbound outbound;
  ReceiveQueue received;
  RequestTable requests;
  CreditBook credits;
  Declarations declarations;
  WatchTable watches;
  NameCache names;
  HubClock clock;
  NodeStatus record;
  std::atomic<std::uint32_t> id{0};
  std::atomic<bool> closing{false};
};

}  // namespace gimnet::nif
