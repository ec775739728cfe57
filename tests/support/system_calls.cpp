#include "tests/support/system_calls.hpp"

#include <linux/filter.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <thread>

namespace gimnet::test {
namespace {

constexpr int kNotYet = -1;
constexpr int kNever = -2;

/// Calls that go on without being told: of the allocator, and of a clock that is not read in the
/// program's own memory.
constexpr std::uint32_t kUntold[] = {SYS_brk,     SYS_mmap,     SYS_munmap,       SYS_mremap,
                                     SYS_madvise, SYS_mprotect, SYS_clock_gettime};

/// Linux 5.9: who lets calls go on is told that there will be none any more.
bool kernel_tells() {
  utsname system{};
  int major = 0;
  int minor = 0;
  if (::uname(&system) != 0 || std::sscanf(system.release, "%d.%d", &major, &minor) != 2)
    return false;
  return major > 5 || (major == 5 && minor >= 9);
}

constexpr sock_filter statement(unsigned code, std::uint32_t value,
                                std::uint8_t skipped_if_not = 0) {
  return {static_cast<std::uint16_t>(code), 0, skipped_if_not, value};
}

/// From now on each system call of this thread waits until the one who has the descriptor lets it
/// go on.
int begin_telling() {
  std::vector<sock_filter> program{statement(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr))};
  for (const std::uint32_t number : kUntold) {
    program.push_back(statement(BPF_JMP | BPF_JEQ | BPF_K, number, 1));
    program.push_back(statement(BPF_RET | BPF_K, SECCOMP_RET_ALLOW));
  }
  program.push_back(statement(BPF_RET | BPF_K, SECCOMP_RET_USER_NOTIF));
  sock_fprog filter{static_cast<std::uint16_t>(program.size()), program.data()};
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return kNever;
  const long listener =
      ::syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_NEW_LISTENER, &filter);
  return listener < 0 ? kNever : static_cast<int>(listener);
}

/// Lets the thread's calls go on until it has ended. False: the kernel cannot.
bool let_go_on(int listener, const std::atomic<bool>& counting, std::vector<int>& calls) {
  for (;;) {
    pollfd ready{listener, POLLIN, 0};
    if (::poll(&ready, 1, -1) < 0 && errno != EINTR) return false;
    if ((ready.revents & POLLIN) == 0) {
      if ((ready.revents & (POLLHUP | POLLERR | POLLNVAL)) != 0) return true;
      continue;
    }
    seccomp_notif call{};
    if (::ioctl(listener, SECCOMP_IOCTL_NOTIF_RECV, &call) != 0) {
      if (errno == EINTR || errno == ENOENT) continue;
      return false;
    }
    if (counting.load()) calls.push_back(call.data.nr);
    seccomp_notif_resp answer{};
    answer.id = call.id;
    answer.flags = SECCOMP_USER_NOTIF_FLAG_CONTINUE;
    if (::ioctl(listener, SECCOMP_IOCTL_NOTIF_SEND, &answer) != 0 && errno != ENOENT) return false;
  }
}

}  // namespace

std::optional<std::vector<int>> system_calls_of(const std::function<void()>& before,
                                                const std::function<void()>& counted) {
  if (!kernel_tells()) return std::nullopt;
  std::atomic<int> listener{kNotYet};
  std::atomic<bool> counting{false};
  std::vector<int> calls;
  std::thread thread([&] {
    listener = begin_telling();
    if (listener == kNever) return;
    before();
    counting = true;
    counted();
    counting = false;
  });
  // That thread could not wake anybody: nobody lets its calls go on yet.
  while (listener == kNotYet) std::this_thread::yield();
  const bool told = listener != kNever && let_go_on(listener, counting, calls);
  if (listener != kNever) ::close(listener);
  thread.join();
  if (!told) return std::nullopt;
  return calls;
}

}  // namespace gimnet::test
