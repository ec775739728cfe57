#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "proto/control/ns_watch.hpp"

namespace gimnet::fuzz {

/// What a node knows by one of its watches. Ends in an abort when it is told something twice, too
/// late, with a gap, or for nothing.
class WatchView {
 public:
  /// WATCH was granted; `under_way` is what an earlier watch of that number has not answered.
  WatchView(const proto::ns::Watch& wanted, bool snapshot, std::uint32_t under_way)
      : wanted_(wanted), awaits_snapshot_(snapshot), under_way_(under_way) {}
  void take(const proto::ns::WatchEvents& events);
  void taken(std::uint32_t frames) { under_way_ -= frames < under_way_ ? frames : under_way_; }

  [[nodiscard]] bool wants(std::uint8_t subject, const std::string& name) const;
  [[nodiscard]] std::uint32_t under_way() const { return under_way_; }
  [[nodiscard]] std::uint64_t epoch() const { return epoch_; }
  [[nodiscard]] std::uint64_t version() const { return version_; }
  /// It knows everything: by a snapshot of its own, not by going on behind one.
  [[nodiscard]] bool complete() const { return complete_; }
  [[nodiscard]] bool awaits_snapshot() const { return awaits_snapshot_; }
  [[nodiscard]] const std::map<std::uint32_t, proto::ns::NodeRecord>& nodes() const {
    return nodes_;
  }
  [[nodiscard]] const std::map<std::uint32_t, proto::ns::ServiceRecord>& services() const {
    return services_;
  }

 private:
  void take_one(const proto::ns::Change& change, const proto::ns::WatchEvents& events);
  void take_node(const proto::ns::Change& change);
  void take_service(const proto::ns::Change& change);

  const proto::ns::Watch wanted_;
  bool awaits_snapshot_;
  bool began_ = false;  ///< a snapshot began and has not ended
  bool complete_ = false;
  std::uint32_t under_way_;
  std::uint64_t epoch_ = 0;
  std::uint64_t version_ = 0;
  std::uint64_t last_change_ = 0;
  bool told_ = false;                                           ///< anything
  std::map<std::uint32_t, proto::ns::NodeRecord> nodes_;        ///< by index
  std::map<std::uint32_t, proto::ns::ServiceRecord> services_;  ///< by group index
};

}  // namespace gimnet::fuzz
