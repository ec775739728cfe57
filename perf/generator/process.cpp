#include "generator/process.hpp"

#include <time.h>

#include <fstream>
#include <string>

#include "net/socket.hpp"

namespace gimnet::perf {
namespace {

std::int64_t status_bytes(pid_t process, const char* name) {
  std::ifstream status("/proc/" + std::to_string(process) + "/status");
  for (std::string word; status >> word;) {
    std::int64_t kibibytes = 0;
    if (word == name && status >> kibibytes) return kibibytes * 1024;
  }
  fail("the measured process is gone");
}

}  // namespace

std::int64_t cpu_time_ns(pid_t process) {
  clockid_t clock{};
  timespec time{};
  if (::clock_getcpuclockid(process, &clock) != 0 || ::clock_gettime(clock, &time) != 0) {
    fail("the measured process is gone");
  }
  return time.tv_sec * 1'000'000'000 + time.tv_nsec;
}

std::int64_t resident_bytes(pid_t process) { return status_bytes(process, "VmRSS:"); }

std::int64_t peak_resident_bytes(pid_t process) { return status_bytes(process, "VmHWM:"); }

}  // namespace gimnet::perf
