#include <pthread.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <mutex>

#include "base/runtime_folder.hpp"
#include "client/nif/platform.hpp"

namespace gimnet::nif {
namespace {

/// The folder is there, belongs to this user, and is closed to everybody else.
bool is_own_folder(const std::string& path) {
  struct stat info{};
  return ::lstat(path.c_str(), &info) == 0 && S_ISDIR(info.st_mode) && info.st_uid == ::geteuid() &&
         (info.st_mode & (S_IRWXG | S_IRWXO)) == 0;
}

constinit std::atomic<std::uint32_t> g_fork_generation{0};

}  // namespace

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : "";
}

std::string runtime_folder() {
  const RuntimeFolder folder = runtime_folder_of_user();
  // XDG_RUNTIME_DIR is nobody else's already. Its owner may have given the folder in it to a
  // container, in which the same user has another id.
  return folder.in_private || is_own_folder(folder.path()) ? folder.path() : "";
}

std::uint32_t fork_generation() {
  static std::once_flag once;
  std::call_once(once, [] {
    static_cast<void>(::pthread_atfork(nullptr, nullptr, [] { g_fork_generation.fetch_add(1); }));
  });
  return g_fork_generation.load(
      std::memory_order_relaxed);  // partner: fetch_add in the child, which has one thread
}

}  // namespace gimnet::nif
