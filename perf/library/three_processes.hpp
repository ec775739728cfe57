#pragma once

#include <sys/types.h>

#include <array>

#include "generator/process.hpp"
#include "generator/scenario.hpp"

namespace gimnet::perf {

/// What hub and both clients used since this was made.
class ThreeProcesses {
 public:
  ThreeProcesses(pid_t sender, pid_t receiver, pid_t hub)
      : meters_{{{"sender", CpuMeter(sender)},
                 {"receiver", CpuMeter(receiver)},
                 {"hub", CpuMeter(hub)}}} {}

  /// Adds user and system time of each, and those of all together, a message.
  void add_to(Findings& findings, double messages) const {
    CpuMeter::Used all;
    for (const auto& [name, meter] : meters_) {
      const CpuMeter::Used used = meter.used();
      findings.add(std::string(name) + "_user_ns_per_message", used.user_ns / messages);
      findings.add(std::string(name) + "_system_ns_per_message", used.system_ns / messages);
      all.user_ns += used.user_ns;
      all.system_ns += used.system_ns;
    }
    findings.add("cpu_ns_per_message", (all.user_ns + all.system_ns) / messages);
    findings.add("system_ns_per_message", all.system_ns / messages);
  }

 private:
  struct Named {
    const char* name;
    CpuMeter meter;
  };
  std::array<Named, 3> meters_;
};

}  // namespace gimnet::perf
