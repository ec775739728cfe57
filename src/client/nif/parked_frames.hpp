#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>

#include "client/nif/frame_run.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::nif {

/// GROUP frames that wait, after a break without resume, until their services are declared again:
/// before that the hub knows none of their groups, and afterwards a service may have another one.
/// Thread safety: guarded by its owner. Limit: what waited in the lanes at the break, and again at
/// each one that follows before the services are through.
class ParkedFrames {
 public:
  using Runs = std::deque<FrameRun>;  ///< Limit: what waited in the lanes, see above
  using Lanes = std::array<Runs, proto::kLaneCount>;

  /// Takes the GROUP frames out of the lanes.
  void take_from(Lanes& lanes);
  /// Those for the group `former` are for `now`, and go back to the front of their lanes. Returns
  /// their bytes.
  std::size_t give_back(std::uint32_t former, std::uint32_t now, Lanes& lanes);
  void set_source(std::uint32_t src);
  /// Returns how many frames there were.
  std::uint64_t drop() noexcept;

  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  Runs runs_;  ///< each of frames for one group
  std::size_t bytes_ = 0;
};

}  // namespace gimnet::nif
