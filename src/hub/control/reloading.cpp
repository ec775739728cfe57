#include "hub/control/reloading.hpp"

#include "base/check.hpp"

namespace gimnet::hub {
namespace {

/// The last line: how many faults are not told here, and where they are.
std::string rest_of(const Reloading& reloading, std::size_t told) {
  std::size_t untold = reloading.faults.size() - told;
  // Of those beside `faults` it is not known how many they are.
  if (reloading.more_faults) ++untold;
  if (untold == 0) return {};
  std::string line = told != 0 ? "\nand " : "\n";
  if (reloading.more_faults) line += "at least ";
  line +=
      std::to_string(untold) + (told != 0 ? " more" : "") + (untold == 1 ? " fault" : " faults");
  return line + (reloading.more_faults
                     ? ": tcphub --check-config tells all of them"
                     : ": the hub's log tells all of them, and so does tcphub --check-config");
}

}  // namespace

void log_faults(const Reloading& reloading) {
  for (const std::string& fault : reloading.faults) log_error(fault);
  if (reloading.more_faults)
    log_error("there are more faults; tcphub --check-config tells all of them");
  log_error("the configuration was not read again: the former one stays in force, whole");
}

std::string reload_summary(const Reloading& reloading) {
  std::string changed;
  std::string restart;
  for (const Reloading::Change& change : reloading.changes) {
    std::string& list = change.needs_restart ? restart : changed;
    list += (list.empty() ? "" : ", ") + change.key + " from " + change.from + " to " + change.to;
  }
  std::string line = "configuration read again: ";
  line += changed.empty() ? "nothing changed" : "changed " + changed;
  if (!restart.empty()) line += "; needs a restart: " + restart;
  return line;
}

std::string reload_refusal(const Reloading& reloading, std::size_t bytes_max) {
  GIMNET_CHECK(!reloading.faults.empty() && bytes_max >= 256);
  std::string sentence = "nothing was changed, the former configuration stays in force";
  std::string whole = sentence + rest_of(reloading, 0);
  for (std::size_t told = 1; told <= reloading.faults.size(); ++told) {
    sentence += "\n" + reloading.faults[told - 1];
    if (sentence.size() > bytes_max) break;
    const std::string rest = rest_of(reloading, told);
    if (sentence.size() + rest.size() <= bytes_max) whole = sentence + rest;
  }
  return whole;
}

}  // namespace gimnet::hub
