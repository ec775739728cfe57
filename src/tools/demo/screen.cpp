#include "tools/demo/screen.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <vector>

#include "tools/demo/figures.hpp"
#include "tools/demo/plot.hpp"
#include "tools/demo/text_format.hpp"

namespace gimnet::demo {
namespace {

constexpr int kPanelColumns = 27;
constexpr int kPanelFromColumns = 64;
constexpr int kPanelFromRows = 12;
constexpr int kStripRows = 3;
constexpr int kStripFromRows = 9;

// A line of keys, the important ones first; as many as fit.
struct KeyHint {
  std::string_view keys;
  std::string_view what;
};
constexpr KeyHint kDriveHints[] = {{"W A S D", "drive"}, {"space", "stop"}, {"Q", "quit"},
                                   {"P", "autopilot"},   {"F", "follow"},   {"+ -", "zoom"},
                                   {"T", "trail"},       {"?", "help"}};
constexpr KeyHint kPlayHints[] = {{"space", "hold"}, {"[ ]", "speed"}, {"Q", "quit"},
                                  {"F", "follow"},   {"+ -", "zoom"},  {"T", "trail"},
                                  {"?", "help"}};

template <std::size_t size>
void draw_hints(Canvas& canvas, const KeyHint (&hints)[size]) {
  const Extent extent = canvas.extent();
  const int row = extent.rows - 1;
  canvas.lay_ground({0, row}, extent.columns, Ground::kBar);
  int column = 1;
  for (const KeyHint& hint : hints) {
    const int width = static_cast<int>(hint.keys.size() + hint.what.size()) + 1;
    if (column + width >= extent.columns) break;
    column = canvas.text({column, row}, hint.keys, Ink::kTitle) + 1;
    column = canvas.text({column, row}, hint.what, Ink::kDim) + 2;
  }
}

void draw_title(Canvas& canvas, const Monitor& monitor, const ScreenState& state) {
  const int columns = canvas.extent().columns;
  canvas.lay_ground({0, 0}, columns, Ground::kBar);
  int column = canvas.text({1, 0}, "GIMnet", Ink::kTitle) + 2;
  const std::string source = monitor.info() ? monitor.info()->source : "waiting for the robot";
  column = canvas.text({column, 0}, source, Ink::kPlain) + 2;
  const double open_s = static_cast<double>(state.now_ns - monitor.start_ns()) * 1e-9;
  const std::string clock = clock_text(open_s);
  const int clock_column = columns - 1 - static_cast<int>(clock.size());
  const std::string hub = state.connected ? state.hub_url : "not connected, dialling again";
  if (column + static_cast<int>(hub.size()) + 2 < clock_column) {
    canvas.text({column, 0}, hub, state.connected ? Ink::kDim : Ink::kBad);
  }
  if (clock_column > column) canvas.text({clock_column, 0}, clock, Ink::kPlain);
}

void draw_help(Canvas& canvas, const Area& area, bool log) {
  std::vector<std::string_view> lines = {
      "F        follow the robot, or show all",
      "+ -      closer, farther",
      "0        as at the beginning",
      "T        trail on, off",
      "Ctrl-L   draw the screen again",
      "Q Ctrl-C quit, with a summary",
      "?        close this",
  };
  const std::vector<std::string_view> own =
      log ? std::vector<std::string_view>{"space    hold the log, go on", "[ ]      slower, faster"}
          : std::vector<std::string_view>{"W A S D  drive, as do the arrows; hold to go on",
                                          "space    stop", "P        let the course drive, or you"};
  lines.insert(lines.begin(), own.begin(), own.end());
  const int columns = std::min(area.extent.columns, 51);
  const int rows = std::min(area.extent.rows, static_cast<int>(lines.size()) + 2);
  const Place corner{area.corner.column + (area.extent.columns - columns) / 2,
                     area.corner.row + (area.extent.rows - rows) / 2};
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column)
      canvas.put({corner.column + column, corner.row + row}, Glyph{});
  }
  canvas.frame({corner, {columns, rows}});
  canvas.text({corner.column + 2, corner.row}, " keys ", Ink::kTitle);
  for (int index = 0; index + 2 < rows; ++index) {
    const std::string_view line = lines[static_cast<std::size_t>(index)];
    canvas.text({corner.column + 2, corner.row + 1 + index},
                line.substr(0, static_cast<std::size_t>(columns - 3)), Ink::kPlain);
  }
}

// The progress of a log, over the lower edge of the map.
void draw_progress(Canvas& canvas, const Area& area, const RobotInfo& info) {
  const std::string_view sign = info.ended ? "●" : info.paused ? "‖" : "▶";
  const std::string text = fmt::format(" {} {} / {} ×{:g} ", sign, clock_text(info.played_s),
                                       clock_text(info.duration_s), info.speed);
  const int row = area.corner.row + area.extent.rows - 1;
  int column = canvas.text({area.corner.column + 1, row}, text, Ink::kTitle);
  const int bar = area.corner.column + area.extent.columns - 2 - column;
  const double part =
      info.duration_s > 0.0 ? std::clamp(info.played_s / info.duration_s, 0.0, 1.0) : 1.0;
  for (int index = 0; index < bar; ++index) {
    canvas.put({column + index, row},
               {index < part * bar ? U'━' : U'─', index < part * bar ? Ink::kTitle : Ink::kFrame});
  }
}

void draw_picture(Canvas& canvas, const Monitor& monitor, const ScreenState& state,
                  const Area& area) {
  canvas.frame(area);
  const Area inner{{area.corner.column + 1, area.corner.row + 1},
                   {area.extent.columns - 2, area.extent.rows - 2}};
  const View view = choose_view(monitor, state.map, inner.extent);
  Plot plot(inner.extent, view);
  draw_map(plot, monitor, state.map);
  plot.draw(canvas, inner.corner);
  if (!monitor.odometry()) {
    canvas.text({inner.corner.column + 1, inner.corner.row}, "no odometry yet", Ink::kDim);
  }
  const bool log = monitor.info() && monitor.info()->is_log();
  if (log) draw_progress(canvas, area, *monitor.info());
  const int scale_row = area.corner.row + area.extent.rows - (log ? 2 : 1);
  draw_scale(canvas, {area.corner.column + 2, scale_row}, view);
  if (log && !monitor.info()->note.empty() && state.now_ns - monitor.start_ns() < 8'000'000'000) {
    const std::string& note = monitor.info()->note;
    canvas.text({inner.corner.column + 1, inner.corner.row},
                note.substr(0, static_cast<std::size_t>(std::max(0, inner.extent.columns - 2))),
                Ink::kWarn);
  }
  if (state.help) draw_help(canvas, area, log);
}

}  // namespace

Canvas draw_screen(const Monitor& monitor, const ScreenState& state, Extent extent) {
  Canvas canvas(extent);
  extent = canvas.extent();
  if (extent.columns < kScreenLeast.columns || extent.rows < kScreenLeast.rows) {
    canvas.text({0, 0}, "GIMnet demo", Ink::kTitle);
    canvas.text({0, 1}, fmt::format("needs {} x {}", kScreenLeast.columns, kScreenLeast.rows),
                Ink::kPlain);
    return canvas;
  }
  draw_title(canvas, monitor, state);
  const bool panel = extent.columns >= kPanelFromColumns && extent.rows >= kPanelFromRows;
  const bool strip = !panel && extent.rows >= kStripFromRows;
  const int picture_columns = extent.columns - (panel ? kPanelColumns : 0);
  const int picture_rows = extent.rows - 2 - (strip ? kStripRows : 0);
  draw_picture(canvas, monitor, state, {{0, 1}, {picture_columns, picture_rows}});
  if (panel)
    draw_panel(canvas, monitor, state, {{picture_columns, 1}, {kPanelColumns, picture_rows}});
  if (strip)
    draw_strip(canvas, monitor, state, {{0, 1 + picture_rows}, {extent.columns, kStripRows}});
  if (monitor.info() && monitor.info()->is_log()) {
    draw_hints(canvas, kPlayHints);
  } else {
    draw_hints(canvas, kDriveHints);
  }
  return canvas;
}

}  // namespace gimnet::demo
