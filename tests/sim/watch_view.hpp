#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "proto/control/ns_watch.hpp"
#include "tests/sim/model.hpp"

namespace gimnet::sim {

/// The nodes and services that a node knows by watching, all or those that fit a pattern.
/// Thread safety: none. Errors: Broken.
class WatchView {
 public:
  WatchView() = default;
  /// `pattern`: "" for all. `subjects` as in WATCH.
  WatchView(std::string pattern, std::uint8_t subjects)
      : pattern_(std::move(pattern)), subjects_(subjects) {}

  /// The node asked to be told everything from here on.
  [[nodiscard]] proto::ns::Watch request(std::uint32_t number) const;
  /// The answer came: with a snapshot, or the hub goes on where this view is.
  void granted(bool snapshot) { awaits_snapshot_ = snapshot; }
  void take(const proto::ns::WatchEvents& events, Census& census);
  /// Is this what the hub owes, now that nothing is under way?
  void require_agreed(const Model& model) const;

 private:
  void take_one(const proto::ns::Change& change, Census& census);
  void require_nodes(const Model& model) const;
  void require_services(const Model& model) const;
  [[nodiscard]] bool fits(const std::string& name) const;

  std::string pattern_;
  std::uint8_t subjects_ = proto::ns::kWatchAll;

  std::uint64_t epoch_ = 0;
  std::uint64_t version_ = 0;
  bool awaits_snapshot_ = false;
  bool complete_ = false;
  std::map<std::uint32_t, proto::ns::NodeRecord> nodes_;        ///< by index
  std::map<std::uint32_t, proto::ns::ServiceRecord> services_;  ///< by group index
};

}  // namespace gimnet::sim
