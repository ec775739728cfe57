#pragma once

#include <sys/types.h>

#include <cstdint>

// The use of time and memory by the measured process, as the kernel counts it. Ends the program
// when the process is gone.

namespace gimnet::perf {

/// User and system time of the whole process, in nanoseconds.
[[nodiscard]] std::int64_t cpu_time_ns(pid_t process);
/// The number of times that its present threads were put on a processor or taken from it. Threads
/// that do nothing are not.
[[nodiscard]] std::int64_t context_switches(pid_t process);

/// The time of a process since this was made, user and system time apart. The sum is exact; their
/// ratio is the kernel's, which with CONFIG_TICK_CPU_ACCOUNTING (Debian's too) looks at each tick
/// whose it is, CONFIG_HZ times a second, and that is all it knows: getrusage() and cgroups tell
/// the same. Few seconds say little of a small part.
class CpuMeter {
 public:
  struct Used {
    double user_ns = 0;
    double system_ns = 0;
  };
  explicit CpuMeter(pid_t process);
  [[nodiscard]] Used used() const;

 private:
  struct Reading {
    std::int64_t all_ns = 0;
    std::int64_t user_ticks = 0;
    std::int64_t system_ticks = 0;
  };
  [[nodiscard]] static Reading read(pid_t process);

  pid_t process_;
  Reading begin_;
};

/// Resident memory in bytes.
[[nodiscard]] std::int64_t resident_bytes(pid_t process);
/// The most that was resident at any time since its start, in bytes.
[[nodiscard]] std::int64_t peak_resident_bytes(pid_t process);

}  // namespace gimnet::perf
