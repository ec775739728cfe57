#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "tools/demo/geometry.hpp"

namespace gimnet::demo {

/// A hall for the simulated robot: a grid of walls and floor, read from text. Each character is a
/// square of `kCell_m`:
///
///     #          wall
///     blank, .   floor
///     @          floor; the robot begins here, facing right
///     1 .. 9     floor; the scripted course visits these in ascending order and begins again
///
/// The last line of the text is y = 0. Everything outside is wall.
/// Thread safety: immutable after construction. Limits: `kColumnsMax`, `kRowsMax`.
class WorldMap {
 public:
  static constexpr double kCell_m = 0.25;
  static constexpr std::size_t kColumnsMax = 256;
  static constexpr std::size_t kRowsMax = 128;

  /// Errors: a character of no meaning, no start, too many rows or columns, a repeated waypoint;
  /// with line and column.
  static Result<WorldMap> parse(std::string_view text);

  /// Reads a map from a file. Errors: as parse(), and those of the file.
  static Result<WorldMap> load(const std::string& path);

  /// The hall that comes with the demo.
  static WorldMap hall();

  [[nodiscard]] std::size_t columns() const { return columns_; }
  [[nodiscard]] std::size_t rows() const { return rows_; }
  [[nodiscard]] double width_m() const { return static_cast<double>(columns_) * kCell_m; }
  [[nodiscard]] double height_m() const { return static_cast<double>(rows_) * kCell_m; }

  /// Is the square a wall? Columns count from the left, rows from the bottom; outside is wall.
  [[nodiscard]] bool wall(long column, long row) const;

  /// Would a disk there touch a wall? `radius_m` is at most 1 m.
  [[nodiscard]] bool touches_wall(const Point& centre, double radius_m) const;

  /// Metres along the ray to the nearest wall, at most `longest_m`.
  [[nodiscard]] double distance_to_wall_m(const Ray& ray, double longest_m) const;

  [[nodiscard]] const Pose& start() const { return start_; }
  /// Corners of the scripted course, in order; may be empty.
  [[nodiscard]] const std::vector<Point>& waypoints() const { return waypoints_; }
  /// The text from which parse() makes an equal map.
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  WorldMap() = default;

  std::size_t columns_ = 0;
  std::size_t rows_ = 0;
  std::vector<char> walls_;
  Pose start_;
  std::vector<Point> waypoints_;
  std::string text_;
};

/// The built-in hall, 18 m by 12 m, in the format of WorldMap: a workshop with pillars, shelves and
/// an office.
extern const std::string_view kHallText;

}  // namespace gimnet::demo
