#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/mutex.hpp"
#include "tools/demo/labs_view.hpp"
#include "tools/demo/monitor.hpp"

namespace gimnet::demo {

/// The streams of the laboratories as their drivers and viewers hear them, for the one that draws.
/// Thread safety: any thread.
class LabsBoard {
 public:
  enum class Lab : std::uint8_t { north, south };

  /// Adds a stream that nothing was heard of. Returns its place for put().
  std::size_t add(Lab lab, const std::string& name) GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    entries_.push_back({lab, {name, 0.0, 0, 0}});
    return entries_.size() - 1;
  }
  /// Notes the losses and the rate of a stream, and the losses of `more`, another one of its
  /// machine.
  void put(std::size_t place, std::int64_t now_ns, const StreamRecord& heard,
           const StreamRecord* more = nullptr) GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    LabsView::Stream& stream = entries_[place].stream;
    stream.rate_hz = heard.rate.rate_hz(now_ns);
    stream.lost = heard.missed + heard.disordered;
    stream.excused = heard.excused;
    if (more == nullptr) return;
    stream.lost += more->missed + more->disordered;
    stream.excused += more->excused;
  }
  void set_round_trip(std::optional<std::int64_t> round_trip_ns) GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    round_trip_ns_ = round_trip_ns;
  }
  [[nodiscard]] std::optional<std::int64_t> round_trip_ns() const GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    return round_trip_ns_;
  }
  /// All streams; nothing of the WAN.
  [[nodiscard]] LabsView view() const GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    LabsView view;
    for (const Entry& entry : entries_)
      (entry.lab == Lab::north ? view.north : view.south).push_back(entry.stream);
    return view;
  }

 private:
  struct Entry {
    Lab lab;
    LabsView::Stream stream;
  };

  mutable Mutex mutex_;
  std::vector<Entry> entries_ GIMNET_GUARDED_BY(mutex_);
  std::optional<std::int64_t> round_trip_ns_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::demo
