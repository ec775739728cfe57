#pragma once

#include <cstddef>
#include <vector>

#include "tools/demo/geometry.hpp"

namespace gimnet::demo {

/// A driver that visits corners in turn, for ever: turns towards the next one, then drives, slower
/// where it must turn. It steers by what it hears from the robot, so that the loop is closed over
/// the network. Thread safety: one thread.
class Course {
 public:
  explicit Course(std::vector<Point> corners) : corners_(std::move(corners)) {}

  /// What to do at that pose. Without corners: stand still.
  [[nodiscard]] Twist steer(const Pose& pose);

  /// Corners that were reached.
  [[nodiscard]] std::size_t reached() const { return reached_; }

 private:
  std::vector<Point> corners_;
  std::size_t next_ = 0;
  std::size_t reached_ = 0;
};

}  // namespace gimnet::demo
