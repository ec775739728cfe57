#pragma once

#include <sys/types.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <string>

#include "generator/process.hpp"
#include "generator/scenario.hpp"
#include "library/library_client.hpp"

// What two programs do with each other: one sends as fast as its library takes it, or round trips
// go one by one.

namespace gimnet::perf {

struct PairOptions {
  std::size_t payload_bytes = 16;
  std::chrono::nanoseconds duration{1'000'000'000};
  std::chrono::nanoseconds patience{2'000'000'000};  ///< a message that takes longer is lost
  pid_t hub = 0;
  pid_t partner = 0;
};

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

/// Sends, with a bounded number of messages under way, for as long as asked, and says what it cost
/// all three processes.
[[nodiscard]] Findings send_bursts(LibraryClient& client, LibraryClient::Setup setup,
                                   const PairOptions& options);
/// The other end of send_bursts(): checks every message and says from time to time how many it has.
/// Does not return.
[[noreturn]] void receive_bursts(LibraryClient& client, LibraryClient::Setup setup,
                                 const PairOptions& options);

/// Round trips one after the other, each begun where the last one ended: on the library's thread.
[[nodiscard]] Findings make_round_trips(LibraryClient& client, LibraryClient::Setup setup,
                                        const PairOptions& options);
/// The other end of make_round_trips(). Does not return.
[[noreturn]] void echo(LibraryClient& client, LibraryClient::Setup setup,
                       const PairOptions& options);

/// Says on standard output that the partner may be started.
void say_ready();

}  // namespace gimnet::perf
