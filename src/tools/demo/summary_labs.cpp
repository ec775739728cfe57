#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "tools/demo/figures.hpp"
#include "tools/demo/summary.hpp"

namespace gimnet::demo {
namespace {

/// Pictures that crossed once leave room for everything else that crosses; twice is more than this.
constexpr double kOnce = 1.8;

double pictures_on_wan(const LabsRecord& record) {
  const double bytes = static_cast<double>(record.pictures * record.picture_bytes);
  return bytes > 0.0 ? static_cast<double>(record.wan_bytes) / bytes : 0.0;
}

/// Frames that had no way, or were on one that broke, or came behind a cut before the subscribers
/// had found the service again.
bool explained_by_cuts(std::string_view reason) {
  constexpr std::array<std::string_view, 5> kReasons{"link_lost", "link_unsure", "no_route", "away",
                                                     "no_subscriber"};
  return std::ranges::find(kReasons, reason) != kReasons.end();
}

std::uint64_t commands_lost(const LabsRecord::Machine& machine) {
  const std::uint64_t arrived = machine.monitor.info().value_or(RobotInfo{}).drive_total;
  return machine.run.finished && arrived < machine.run.commands ? machine.run.commands - arrived
                                                                : 0;
}

/// Messages and commands of a machine that were lost.
std::uint64_t lost_of(const LabsRecord::Machine& machine) {
  return machine.monitor.odometry_stream().missed + machine.monitor.scan_stream().missed +
         commands_lost(machine);
}

std::uint64_t pictures_lost(const LabsRecord& record) {
  std::uint64_t lost = 0;
  for (const StreamRecord& seen : record.seen) lost += seen.missed;
  return lost;
}

void complain_of_hubs(std::vector<std::string>& all, const LabsRecord& record) {
  for (const LabsRecord::Hub& hub : record.hubs) {
    for (const auto& [reason, frames] : hub.counters.drops) {
      if (reason == "replaced" || (record.cuts != 0 && explained_by_cuts(reason))) continue;
      all.push_back(fmt::format("hub {} dropped {} frames: {}", hub.name, frames, reason));
    }
    if (!hub.counters.exact())
      all.push_back(fmt::format("the ledger of hub {} does not add up", hub.name));
  }
}

void complain_of_pictures(std::vector<std::string>& all, const LabsRecord& record) {
  for (const StreamRecord& seen : record.seen) {
    if (seen.received + seen.excused == record.pictures) continue;
    all.push_back(fmt::format(
        "camera/eye: {} pictures were sent, a viewer has {}{}", record.pictures, seen.received,
        seen.excused == 0 ? "" : fmt::format(", and the cuts explain {}", seen.excused)));
  }
  if (record.pictures == 0) all.emplace_back("camera/eye: there was no picture");
  if (pictures_on_wan(record) > kOnce) {
    all.push_back(fmt::format("the pictures crossed the WAN more than once: {} bytes",
                              count_text(record.wan_bytes)));
  }
}

std::string verdict(const LabsRecord& record) {
  const std::vector<std::string> complaints = complaints_about(record);
  if (!complaints.empty()) {
    std::string text = "\nNot as it should be:\n";
    for (const std::string& complaint : complaints) text += fmt::format("  {}\n", complaint);
    return text;
  }
  std::uint64_t lost = pictures_lost(record);
  for (const LabsRecord::Machine& machine : record.machines) lost += lost_of(machine);
  if (lost == 0) return "\nNothing was lost.\n";
  return fmt::format(
      "\nAs it should be: {} {} lost, all of them on their way over the WAN\n"
      "in one of its cuts, or within 1.5 s after it.\n",
      count_text(lost), lost == 1 ? "message was" : "messages were");
}

}  // namespace

std::vector<std::string> complaints_about(const LabsRecord& record) {
  std::vector<std::string> all;
  for (const LabsRecord::Machine& machine : record.machines) {
    for (const std::string& complaint : complaints_about(machine.monitor, machine.run))
      all.push_back(fmt::format("{}: {}", machine.name, complaint));
    if (!machine.run.finished && machine.run.broken.empty() && machine.monitor.info())
      all.push_back(fmt::format("{}: did not tell at the end what it had sent", machine.name));
  }
  complain_of_hubs(all, record);
  complain_of_pictures(all, record);
  return all;
}

std::string summary_text(const LabsRecord& record) {
  std::string text = fmt::format("  {:<11}{:<26}{:>7}{:>7}{:>10}{:>7}{:>9}\n", "machine", "kind",
                                 "odom", "scans", "commands", "lost", "way m");
  for (const LabsRecord::Machine& machine : record.machines) {
    text += fmt::format("  {:<11}{:<26}{:>7}{:>7}{:>10}{:>7}{:>9.1f}\n", machine.name, machine.kind,
                        count_text(machine.monitor.odometry_stream().received),
                        count_text(machine.monitor.scan_stream().received),
                        count_text(machine.run.commands), count_text(lost_of(machine)),
                        machine.monitor.way_m());
  }
  text += fmt::format("\n  camera/eye: {} pictures of {} bytes for {} viewers, {} lost\n",
                      count_text(record.pictures), count_text(record.picture_bytes),
                      record.seen.size(), count_text(pictures_lost(record)));
  text += fmt::format("  WAN: cut {} {}; {} bytes to the viewers, {:.2f} times the pictures\n\n",
                      record.cuts, record.cuts == 1 ? "time" : "times",
                      count_text(record.wan_bytes), pictures_on_wan(record));
  for (const auto& [name, hub] : record.hubs) {
    text += fmt::format(
        "  hub {:<6} accepted {} + copies {}\n             = delivered {} + dropped {} + queued "
        "{}\n",
        name, count_text(hub.accepted), count_text(hub.copies), count_text(hub.delivered),
        count_text(hub.dropped()), count_text(hub.queued));
    for (const auto& [reason, frames] : hub.drops)
      text += fmt::format("             dropped: {} {}\n", count_text(frames), reason);
  }
  return text + verdict(record);
}

}  // namespace gimnet::demo
