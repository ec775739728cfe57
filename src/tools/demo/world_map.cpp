#include "tools/demo/world_map.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "base/check.hpp"
#include "tools/demo/line_reader.hpp"

namespace gimnet::demo {
namespace {

std::vector<std::string_view> lines_of(std::string_view text) {
  std::vector<std::string_view> lines;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    lines.push_back(text.substr(0, end));
    text = end == std::string_view::npos ? std::string_view{} : text.substr(end + 1);
  }
  return lines;
}

double cell_centre_m(std::size_t index) {
  return (static_cast<double>(index) + 0.5) * WorldMap::kCell_m;
}

long cell_of(double coordinate_m) {
  return static_cast<long>(std::floor(coordinate_m / WorldMap::kCell_m));
}

// One axis of a walk through a grid: which cell, which way, and how far along the ray the next
// border is.
struct Axis {
  long cell;
  long step;
  double next_m;
  double period_m;

  Axis(double origin_m, double direction)
      : cell(cell_of(origin_m)), step(direction < 0.0 ? -1 : 1) {
    if (direction == 0.0) {
      next_m = period_m = std::numeric_limits<double>::infinity();
      return;
    }
    const double border_m = static_cast<double>(cell + (step > 0 ? 1 : 0)) * WorldMap::kCell_m;
    next_m = (border_m - origin_m) / direction;
    period_m = WorldMap::kCell_m / std::abs(direction);
  }

  double advance() {
    const double crossed_m = next_m;
    cell += step;
    next_m += period_m;
    return crossed_m;
  }
};

}  // namespace

Result<WorldMap> WorldMap::parse(std::string_view text) {
  const std::vector<std::string_view> lines = lines_of(text);
  WorldMap map;
  map.text_ = std::string(text);
  map.rows_ = lines.size();
  for (const std::string_view line : lines) map.columns_ = std::max(map.columns_, line.size());
  if (map.rows_ > kRowsMax || map.columns_ > kColumnsMax) {
    return Error{fmt::format("the map has {} columns and {} rows; at most {} and {} are allowed",
                             map.columns_, map.rows_, kColumnsMax, kRowsMax)};
  }
  map.walls_.assign(map.rows_ * map.columns_, 0);
  std::array<std::optional<Point>, 10> corners;
  bool started = false;
  for (std::size_t number = 0; number < lines.size(); ++number) {
    const std::size_t row = map.rows_ - 1 - number;
    for (std::size_t column = 0; column < lines[number].size(); ++column) {
      const char c = lines[number][column];
      const Point centre{cell_centre_m(column), cell_centre_m(row)};
      const auto where = [&] { return fmt::format("line {}, column {}", number + 1, column + 1); };
      if (c == '#') {
        map.walls_[row * map.columns_ + column] = 1;
      } else if (c == '@') {
        if (started) return Error{fmt::format("{}: a second start '@'; keep one", where())};
        map.start_ = {centre.x_m, centre.y_m, 0.0};
        started = true;
      } else if (c >= '1' && c <= '9') {
        std::optional<Point>& corner = corners[static_cast<std::size_t>(c - '0')];
        if (corner)
          return Error{
              fmt::format("{}: a second waypoint '{}'; each digit may stand once", where(), c)};
        corner = centre;
      } else if (c != ' ' && c != '.') {
        return Error{fmt::format(
            "{}: a character (code {}) that means nothing; use # for walls, blanks or . for floor, "
            "@ for the start, 1 to 9 for the course",
            where(), static_cast<unsigned char>(c))};
      }
    }
  }
  if (!started) return Error{"the map has no start; put an @ where the robot begins"};
  for (const std::optional<Point>& corner : corners) {
    if (corner) map.waypoints_.push_back(*corner);
  }
  return map;
}

Result<WorldMap> WorldMap::load(const std::string& path) {
  Result<LineReader> reader = LineReader::open(path);
  if (!reader) return reader.error();
  std::string text;
  std::string_view line;
  while (text.size() <= (kColumnsMax + 1) * kRowsMax) {
    const Result<bool> more = reader->next(line);
    if (!more) return more.error();
    if (!*more) break;
    if (reader->is_too_long())
      return Error{fmt::format("{}: a line is longer than 1 MiB; is this a text file?", path)};
    text.append(line).push_back('\n');
  }
  if (reader->is_cut())
    return Error{fmt::format("{}: the gzip archive ends too early; copy the file again", path)};
  Result<WorldMap> map = parse(text);
  if (!map) return Error{fmt::format("{}: {}", path, map.error().sentence)};
  return map;
}

WorldMap WorldMap::hall() {
  Result<WorldMap> map = parse(kHallText);
  GIMNET_CHECK(map.has_value());
  return std::move(*map);
}

bool WorldMap::wall(long column, long row) const {
  if (column < 0 || row < 0) return true;
  const auto x = static_cast<std::size_t>(column);
  const auto y = static_cast<std::size_t>(row);
  return x >= columns_ || y >= rows_ || walls_[y * columns_ + x] != 0;
}

bool WorldMap::touches_wall(const Point& centre, double radius_m) const {
  for (long row = cell_of(centre.y_m - radius_m); row <= cell_of(centre.y_m + radius_m); ++row) {
    for (long column = cell_of(centre.x_m - radius_m); column <= cell_of(centre.x_m + radius_m);
         ++column) {
      if (!wall(column, row)) continue;
      const double left_m = static_cast<double>(column) * kCell_m;
      const double bottom_m = static_cast<double>(row) * kCell_m;
      const Point nearest{std::clamp(centre.x_m, left_m, left_m + kCell_m),
                          std::clamp(centre.y_m, bottom_m, bottom_m + kCell_m)};
      if (distance_m(nearest, centre) < radius_m) return true;
    }
  }
  return false;
}

// Amanatides and Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing", 1987.
double WorldMap::distance_to_wall_m(const Ray& ray, double longest_m) const {
  Axis x(ray.origin.x_m, std::cos(ray.heading_rad));
  Axis y(ray.origin.y_m, std::sin(ray.heading_rad));
  double travelled_m = 0.0;
  while (travelled_m < longest_m) {
    if (wall(x.cell, y.cell)) return travelled_m;
    travelled_m = x.next_m < y.next_m ? x.advance() : y.advance();
  }
  return longest_m;
}

// clang-format off
const std::string_view kHallText = R"(########################################################################
#                                                 #                    #
#                                                 #   ####             #
#                                    #######      #   ####        #### #
#                   #########        #######      #               #### #
#                   #########        #######      #               #### #
#    ##                              #######      #                    #
#    ##                                           #                    #
#    ##                                                                #
#    ##                         2                                      #
#    ##                                       3         4              #
#    ##                                                                #
#    ##                                                                #
#    ##                                           #                    #
#    ##         ##                ##              #           5        #
#    ##         ##                ##              #                    #
#    ##                                           #                    #
#    ##             1                             ##########     #######
#    ##                                                                #
#    ##                                                                #
#    ##                                                                #
#                       ####                                           #
#                      ######                                          #
#          @           ######                                 6        #
#                      ######                                       ####
#                      ######                                       ####
#                       ####                                        ####
#    ##                                                             ####
#    ##                                                             ####
#    ##                                                             ####
#    ##                                                       ##    ####
#    ##                                                      ##     ####
#    ##         ##                ##           7            ##      ####
#    ##         ##                ##                       ##       ####
#    ##                                                   ##        ####
#    ##                                                  ##            #
#    ##                                                 ##             #
#    ##    9                  8                        ##              #
#    ##                                               ##               #
#    ##                                              ##                #
#    ##               #########     #####           ##                 #
#    ##               #########     #####                              #
#                     #########     #####                     #####    #
#                                   #####                     #####    #
#                                   #####                     #####    #
#                                                             #####    #
#                                                             #####    #
########################################################################
)";
// clang-format on

}  // namespace gimnet::demo
