#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "base/mutex.hpp"

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

}  // namespace gimnet::nif
