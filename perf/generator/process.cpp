#include "generator/process.hpp"

#include <time.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>

#include "net/socket.hpp"

namespace gimnet::perf {
namespace {

/// The sum of the numbers behind words that end so, in a file of /proc; 0: it is gone.
std::int64_t sum_in(const std::filesystem::path& status, std::string_view ending) {
  std::ifstream file(status);
  std::int64_t sum = 0;
  for (std::string word; file >> word;) {
    std::int64_t number = 0;
    if (word.ends_with(ending) && file >> number) sum += number;
  }
  return sum;
}

std::filesystem::path folder_of(pid_t process) { return "/proc/" + std::to_string(process); }

std::int64_t memory_bytes(pid_t process, std::string_view name) {
  const std::int64_t kibibytes = sum_in(folder_of(process) / "status", name);
  if (kibibytes == 0) fail("the measured process is gone");
  return kibibytes * 1024;
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

std::int64_t context_switches(pid_t process) {
  std::error_code error;
  std::int64_t sum = 0;
  for (const auto& thread : std::filesystem::directory_iterator(folder_of(process) / "task", error))
    sum += sum_in(thread.path() / "status", "voluntary_ctxt_switches:");
  if (error) fail("the measured process is gone");
  return sum;
}

CpuMeter::CpuMeter(pid_t process) : process_(process), begin_(read(process)) {}

CpuMeter::Reading CpuMeter::read(pid_t process) {
  Reading reading{.all_ns = cpu_time_ns(process)};
  std::ifstream file(folder_of(process) / "stat");
  std::string word;
  std::getline(file, word, ')');  // the name may hold anything else
  // proc(5): utime and stime are the 14th and 15th field, the name is the second.
  for (int skipped = 3; skipped < 14; ++skipped) file >> word;
  if (!(file >> reading.user_ticks >> reading.system_ticks)) fail("the measured process is gone");
  return reading;
}

CpuMeter::Used CpuMeter::used() const {
  const Reading now = read(process_);
  const auto all_ns = static_cast<double>(now.all_ns - begin_.all_ns);
  const auto user = static_cast<double>(now.user_ticks - begin_.user_ticks);
  const auto system = static_cast<double>(now.system_ticks - begin_.system_ticks);
  const double system_share = user + system > 0 ? system / (user + system) : 0;
  return {.user_ns = all_ns * (1 - system_share), .system_ns = all_ns * system_share};
}

std::int64_t resident_bytes(pid_t process) { return memory_bytes(process, "VmRSS:"); }

std::int64_t peak_resident_bytes(pid_t process) { return memory_bytes(process, "VmHWM:"); }

}  // namespace gimnet::perf
