#include "hub/config/reloader.hpp"

#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "base/log.hpp"

namespace gimnet::hub {

std::optional<ReadConfiguration> ConfigReader::read(const ConfigSources& sources,
                                                    const ReadOptions& how) {
  using std::future_status;
  if (begun_.valid() && begun_.wait_for(std::chrono::seconds{0}) != future_status::ready)
    return std::nullopt;
  std::packaged_task<ReadConfiguration()> reading(
      [read = read_, sources, how] { return read(sources, how); });
  begun_ = reading.get_future();
  std::thread(std::move(reading)).detach();
  if (begun_.wait_for(patience_) != future_status::ready) return std::nullopt;
  return begun_.get();
}

Reloading Reloader::read_again() {
  Reloading reloading;
  std::optional<ReadConfiguration> found;
  try {
    found = reader_.read(sources_, {.faults_max = kReloadFaultsMax});
  } catch (const std::system_error& error) {
    reloading.faults.push_back(
        "cannot begin to read the configuration: " + error.code().message() +
        "; raise the limit on threads (ulimit -u), or let other programs go");
    return reloading;
  }
  if (!found) {
    const std::string where = sources_.file.empty() ? "" : " (" + sources_.file + ")";
    reloading.faults.push_back("the configuration" + where +
                               " could not be read in time: the disk does not answer; "
                               "mend that, or keep it on a disk of this machine, and try again");
    return reloading;
  }
  ReadConfiguration& read = *found;
  for (const Fault& fault : read.faults) reloading.faults.push_back(fault.line());
  reloading.more_faults = read.more_faults;
  if (!reloading.faults.empty()) return reloading;
  for (const Fault& warning : read.warnings) log_warning(warning.text());
  // A file that appeared in a default place is the hub's from now on, and must not go unnoticed
  // when it goes.
  sources_.file = read.place.file;
  sources_.parts_alone = read.place.parts_alone;
  const HubOptions& wanted = read.configuration.options;
  for (const Setting& setting : settings()) {
    std::string from = setting.show(in_force_);
    std::string to = setting.show(wanted);
    if (from == to) continue;
    reloading.changes.push_back(
        {std::string{setting.key}, std::move(from), std::move(to), !setting.reloads});
  }
  for (const LimitInfo& limit : limit_table()) {
    const std::uint64_t from = in_force_.limits.*limit.field;
    const std::uint64_t to = wanted.limits.*limit.field;
    if (from == to) continue;
    reloading.changes.push_back({"limits." + std::string{limit.name}, std::to_string(from),
                                 std::to_string(to), !limit.reloads});
    if (limit.reloads) in_force_.limits.*limit.field = to;
  }
  in_force_.log_level = wanted.log_level;
  reloading.log_level = wanted.log_level;
  reloading.limits = in_force_.limits;
  return reloading;
}

}  // namespace gimnet::hub
