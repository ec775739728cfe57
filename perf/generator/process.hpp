#pragma once

#include <sys/types.h>

#include <cstdint>

// What the measured process has used, as the kernel counts it. Ends the program when the process is gone.

namespace gimnet::perf {

/// User and system time of the whole process, in nanoseconds.
[[nodiscard]] std::int64_t cpu_time_ns(pid_t process);
/// Resident memory in bytes.
[[nodiscard]] std::int64_t resident_bytes(pid_t process);
/// The most that was resident at any time since its start, in bytes.
[[nodiscard]] std::int64_t peak_resident_bytes(pid_t process);

}  // namespace gimnet::perf
