#include "tools/demo/summary.hpp"

#include <fmt/format.h>

#include <array>
#include <string_view>
#include <vector>

#include "tools/demo/figures.hpp"
#include "tools/demo/terminal.hpp"

namespace gimnet::demo {
namespace {

std::string reduced_to_ascii(const std::string& text) {
  std::string reduced;
  for (const char32_t code : decoded_utf8(text))
    reduced += code == U'\n' ? '\n' : ascii_for({code});
  return reduced;
}

// Texts at the right of their columns; fmt counts the columns of UTF-8.
std::string row(std::string_view name, const std::array<std::string, 7>& cells) {
  constexpr std::array<int, 7> kWidths{8, 10, 7, 8, 10, 10, 10};
  std::string line = fmt::format("  {:<12}", name);
  for (std::size_t index = 0; index < cells.size(); ++index) {
    line += fmt::format("{:>{}}", cells[index], kWidths[index]);
  }
  return line + "\n";
}

// A row of a stream of which so many were sent and received.
std::string stream_row(std::string_view name, std::uint64_t sent, std::uint64_t received,
                       const RunRecord& run, const SampleWindow& age) {
  const std::string rate =
      run.seconds > 0.0 ? fmt::format("{:.1f}", static_cast<double>(received) / run.seconds) : "–";
  return row(name, {count_text(sent), count_text(received),
                    count_text(sent > received ? sent - received : 0), rate,
                    duration_text(age.percentile_ns(50)), duration_text(age.percentile_ns(99)),
                    duration_text(age.percentile_ns(100))});
}

}  // namespace

std::vector<std::string> complaints_about(const Monitor& monitor, const RunRecord& run) {
  std::vector<std::string> complaints;
  if (!run.broken.empty()) complaints.push_back(run.broken);
  if (!monitor.info())
    return {run.broken.empty() ? "the robot was never heard; did its process start?" : run.broken};
  const RobotInfo& info = *monitor.info();
  const auto stream = [&](std::string_view name, const StreamRecord& record, std::uint64_t sent) {
    if (record.missed > record.excused) {
      complaints.push_back(
          fmt::format("{}: {} messages were missed", name, record.missed - record.excused));
    }
    if (record.disordered != 0) {
      complaints.push_back(
          fmt::format("{}: {} messages came twice or out of order", name, record.disordered));
    }
    if (run.finished && record.received + record.excused != sent) {
      complaints.push_back(
          fmt::format("{}: the robot sent {} messages, {} arrived", name, sent, record.received));
    }
  };
  stream("robot/odom", monitor.odometry_stream(), info.odometry_total);
  stream("robot/scan", monitor.scan_stream(), info.scan_total);
  const bool commanded =
      info.drive_total <= run.commands && run.commands - info.drive_total <= run.commands_excused;
  if (run.finished && !commanded) {
    complaints.push_back(fmt::format("robot/drive: {} commands were sent, {} reached the robot",
                                     run.commands, info.drive_total));
  }
  // A log may hold only odometry, or only scans; the other stream is not missed.
  const bool heard_nothing = monitor.odometry_stream().received == 0;
  if (heard_nothing && info.odometry_total != 0)
    complaints.emplace_back("robot/odom: no message came at all");
  if (heard_nothing && monitor.scan_stream().received == 0) {
    complaints.emplace_back("robot/odom, robot/scan: no message came at all");
  }
  if (monitor.garbled_messages() != 0) {
    complaints.push_back(fmt::format("{} messages could not be read", monitor.garbled_messages()));
  }
  if (!monitor.hub()) {
    complaints.emplace_back("the hub did not give its counters");
    return complaints;
  }
  for (const auto& [reason, frames] : monitor.hub()->drops) {
    if (run.own_hub && reason != "replaced")
      complaints.push_back(fmt::format("the hub dropped {} frames: {}", frames, reason));
  }
  if (run.finished && !monitor.hub()->exact())
    complaints.emplace_back("the hub's ledger does not add up");
  return complaints;
}

std::string summary_text(const Monitor& monitor, const RunRecord& run, bool utf8) {
  const RobotInfo info = monitor.info().value_or(RobotInfo{});
  std::string text =
      fmt::format("{} for {:.1f} s over {}\n\n", info.source.empty() ? "nothing" : info.source,
                  run.seconds, run.hub_url);
  text += row("", {"sent", "received", "lost", "Hz", "p50", "p99", "worst"});
  // Totals of a robot that is still running are a second old.
  const StreamRecord& odometry = monitor.odometry_stream();
  const StreamRecord& scan = monitor.scan_stream();
  const auto sent = [&run](const StreamRecord& record, std::uint64_t total) {
    return run.finished ? total : record.received + record.missed;
  };
  text += stream_row("robot/odom", sent(odometry, info.odometry_total), odometry.received, run,
                     odometry.age);
  text += stream_row("robot/scan", sent(scan, info.scan_total), scan.received, run, scan.age);
  text += stream_row("robot/drive", run.commands, run.finished ? info.drive_total : run.commands,
                     run, monitor.drive_stream().age);
  text +=
      "\n  p50, p99, worst: age of a message on arrival; of a command, time until the\n"
      "  first odometry that follows it.\n\n";
  if (monitor.hub()) {
    const HubCounters& hub = *monitor.hub();
    text += fmt::format(
        "  hub: accepted {} + copies {}\n       = delivered {} + dropped {} + queued {}: {}\n",
        count_text(hub.accepted), count_text(hub.copies), count_text(hub.delivered),
        count_text(hub.dropped()), count_text(hub.queued),
        hub.exact() ? "exact" : "does not add up");
    for (const auto& [reason, frames] : hub.drops)
      text += fmt::format("  dropped: {} {}\n", frames, reason);
  }
  text += fmt::format("  way: {:.1f} m", monitor.way_m());
  text += run.corners != 0 ? fmt::format(", {} of the course's corners\n", run.corners) : "\n";
  const std::vector<std::string> complaints = complaints_about(monitor, run);
  text += complaints.empty() ? "\nNothing was lost.\n" : "\nNot as it should be:\n";
  for (const std::string& complaint : complaints) text += fmt::format("  {}\n", complaint);
  return utf8 ? text : reduced_to_ascii(text);
}

}  // namespace gimnet::demo
