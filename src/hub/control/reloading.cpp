#include "hub/control/reloading.hpp"

namespace gimnet::hub {

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

}  // namespace gimnet::hub
