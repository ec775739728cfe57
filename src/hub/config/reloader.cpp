#include "hub/config/reloader.hpp"

#include <algorithm>
#include <span>
#include <string>
#include <utility>

namespace gimnet::hub {

Reloading Reloader::read_again() {
  Reloading reloading;
  const ReadConfiguration read = read_configuration(sources_);
  const std::size_t told = std::min(read.faults.size(), kReloadFaultsMax);
  for (const ConfigFault& fault : std::span(read.faults).first(told))
    reloading.faults.push_back(fault.line());
  reloading.more_faults = told < read.faults.size();
  if (!reloading.faults.empty()) return reloading;
  // A file that appeared in a default place is the hub's from now on, and must not go unnoticed
  // when it goes.
  sources_.file = read.file;
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
