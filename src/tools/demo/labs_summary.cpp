#include "tools/demo/labs_summary.hpp"

#include <fmt/format.h>

#include "tools/demo/figures.hpp"

namespace gimnet::demo {
namespace {

/// Pictures that crossed once leave room for everything else that crosses; twice is more than this.
constexpr double kOnce = 1.8;

double pictures_on_wan(const LabsRecord& record) {
  const double bytes = static_cast<double>(record.pictures * record.picture_bytes);
  return bytes > 0.0 ? static_cast<double>(record.wan_bytes) / bytes : 0.0;
}

}  // namespace

std::vector<std::string> complaints_about(const LabsRecord& record) {
  std::vector<std::string> all;
  for (const LabsRecord::Machine& machine : record.machines) {
    for (const std::string& complaint : complaints_about(machine.monitor, machine.run))
      all.push_back(fmt::format("{}: {}", machine.name, complaint));
  }
  for (const LabsRecord::Hub& hub : record.hubs) {
    for (const auto& [reason, frames] : hub.counters.drops) {
      if (reason != "replaced")
        all.push_back(fmt::format("hub {} dropped {} frames: {}", hub.name, frames, reason));
    }
    if (!hub.counters.exact())
      all.push_back(fmt::format("the ledger of hub {} does not add up", hub.name));
  }
  for (const std::uint64_t seen : record.seen) {
    if (seen != record.pictures) {
      all.push_back(
          fmt::format("camera/eye: {} pictures were sent, a viewer has {}", record.pictures, seen));
    }
  }
  if (record.pictures == 0) all.emplace_back("camera/eye: there was no picture");
  if (pictures_on_wan(record) > kOnce) {
    all.push_back(fmt::format("the pictures crossed the WAN more than once: {} bytes",
                              count_text(record.wan_bytes)));
  }
  return all;
}

std::string summary_text(const LabsRecord& record) {
  std::string text = fmt::format("  {:<11}{:<26}{:<9}{:<9}{:>8}{:>8}{:>10}{:>9}\n", "machine",
                                 "kind", "at hub", "driven", "odom", "scans", "commands", "way m");
  for (const LabsRecord::Machine& machine : record.machines) {
    text += fmt::format("  {:<11}{:<26}{:<9}{:<9}{:>8}{:>8}{:>10}{:>9.1f}\n", machine.name,
                        machine.kind, machine.hub, machine.driven_from,
                        count_text(machine.monitor.odometry_stream().received),
                        count_text(machine.monitor.scan_stream().received),
                        count_text(machine.run.commands), machine.monitor.way_m());
  }
  text += fmt::format("\n  camera/eye: {} pictures of {} bytes, seen by {} viewers\n",
                      count_text(record.pictures), count_text(record.picture_bytes),
                      record.seen.size());
  text +=
      fmt::format("  WAN: {} bytes towards the viewers, {:.2f} times the pictures; cut {} {}\n\n",
                  count_text(record.wan_bytes), pictures_on_wan(record), record.cuts,
                  record.cuts == 1 ? "time" : "times");
  for (const auto& [name, hub] : record.hubs) {
    text +=
        fmt::format("  hub {:<6} accepted {} + copies {} = delivered {} + dropped {} + queued {}\n",
                    name, count_text(hub.accepted), count_text(hub.copies),
                    count_text(hub.delivered), count_text(hub.dropped()), count_text(hub.queued));
  }
  const std::vector<std::string> complaints = complaints_about(record);
  text += complaints.empty() ? "\nNothing was lost.\n" : "\nNot as it should be:\n";
  for (const std::string& complaint : complaints) text += fmt::format("  {}\n", complaint);
  return text;
}

}  // namespace gimnet::demo
