#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>

#include "base/descriptor.hpp"
#include "base/runtime_folder.hpp"
#include "client/nif/locked_file.hpp"

namespace gimnet::nif {
namespace {

constexpr mode_t kFolderMode = 0700;
constexpr mode_t kFileMode = 0600;
/// A file may be removed between its opening and its locking by the one who had it; each try meets
/// another of those.
constexpr int kTries = 16;
constexpr std::size_t kLocksMax = 4'096;

/// Locked descriptors, so that a child can close them: a lock lives as long as any process has its
/// descriptor. 0: free, else the descriptor plus 1.
constinit std::array<std::atomic<int>, kLocksMax> g_locked{};

/// In a child after fork(), which has one thread: only what may be called in a signal handler.
void close_in_child() {
  for (std::atomic<int>& entry : g_locked) {
    if (const int value = entry.exchange(0); value != 0) ::close(value - 1);
  }
}

/// False: too many are locked already.
bool enlist(Descriptor descriptor) {
  static const bool registered = ::pthread_atfork(nullptr, nullptr, close_in_child) == 0;
  if (!registered) return false;
  for (std::atomic<int>& entry : g_locked) {
    int free = 0;
    if (entry.compare_exchange_strong(free, descriptor + 1)) return true;
  }
  return false;
}

/// False: a child, in which it was closed already.
bool strike_off(Descriptor descriptor) {
  for (std::atomic<int>& entry : g_locked) {
    int value = descriptor + 1;
    if (entry.compare_exchange_strong(value, 0)) return true;
  }
  return false;
}

bool is_private(const struct stat& info) {
  return info.st_uid == ::geteuid() && (info.st_mode & (S_IRWXG | S_IRWXO)) == 0;
}

/// Does the folder still have this very file under that name?
bool is_there(Descriptor folder, const char* name, const struct stat& opened) {
  struct stat named{};
  return ::fstatat(folder, name, &named, AT_SYMLINK_NOFOLLOW) == 0 &&
         named.st_ino == opened.st_ino && named.st_dev == opened.st_dev;
}

}  // namespace

PrivateFolder::PrivateFolder() {
  const RuntimeFolder folder = runtime_folder_of_user();
  descriptor_ = ::open(folder.above.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor_ < 0) {
    fault_ = "cannot use the folder " + folder.above + ": " + system_text(errno);
    return;
  }
  enter(descriptor_, folder.name, folder.path());
  if (fault_.empty()) enter(descriptor_, "tokens", folder.path() + "/tokens");
}

PrivateFolder::~PrivateFolder() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void PrivateFolder::enter(Descriptor above, const std::string& name, const std::string& path) {
  if (::mkdirat(above, name.c_str(), kFolderMode) != 0 && errno != EEXIST) {
    fault_ = "cannot make the folder " + path + ": " + system_text(errno);
    return;
  }
  const Descriptor inner =
      ::openat(above, name.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (inner < 0) {
    fault_ = "cannot use " + path + ": " + system_text(errno) + "; it has to be a folder";
    return;
  }
  struct stat info{};
  if (::fstat(inner, &info) != 0 || !is_private(info)) {
    fault_ = "cannot use the folder " + path +
             ": it is another user's, or others have rights in it; chmod 700 " + path;
    ::close(inner);
    return;
  }
  ::close(std::exchange(descriptor_, inner));
  path_ = path;
}

LockedFile::LockedFile(LockedFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)) {}

LockedFile& LockedFile::operator=(LockedFile&& other) noexcept {
  if (this != &other) {
    close();
    descriptor_ = std::exchange(other.descriptor_, -1);
  }
  return *this;
}

LockedFile::State LockedFile::open(const PrivateFolder& folder, const std::string& name,
                                   bool made) {
  // A file that is no file of ours is not touched: no link is followed, and opening a pipe does not
  // wait.
  const int flags = O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC | (made ? O_CREAT : 0);
  for (int i = 0; i < kTries; ++i) {
    const Descriptor file = ::openat(folder.descriptor(), name.c_str(), flags, kFileMode);
    if (file < 0) return errno == ENOENT && !made ? State::missing : State::refused;
    struct stat info{};
    if (::fstat(file, &info) != 0 || !S_ISREG(info.st_mode) || !is_private(info)) {
      ::close(file);
      return State::refused;
    }
    if (::flock(file, LOCK_EX | LOCK_NB) != 0) {
      const bool in_use = errno == EWOULDBLOCK;
      ::close(file);
      return in_use ? State::in_use : State::refused;
    }
    if (is_there(folder.descriptor(), name.c_str(), info)) {
      if (!enlist(file)) {
        ::close(file);
        return State::refused;
      }
      descriptor_ = file;
      return State::open;
    }
    ::close(file);
  }
  return State::in_use;
}

std::size_t LockedFile::read(std::span<std::byte> memory) const {
  const ssize_t count = ::pread(descriptor_, memory.data(), memory.size(), 0);
  return count > 0 ? static_cast<std::size_t>(count) : 0;
}

bool LockedFile::write(std::span<const std::byte> content) {
  const bool written = ::pwrite(descriptor_, content.data(), content.size(), 0) ==
                       static_cast<ssize_t>(content.size());
  return written && ::ftruncate(descriptor_, static_cast<off_t>(content.size())) == 0;
}

void LockedFile::remove(const PrivateFolder& folder, const std::string& name) {
  struct stat info{};
  if (::fstat(descriptor_, &info) == 0 && is_there(folder.descriptor(), name.c_str(), info)) {
    static_cast<void>(::unlinkat(folder.descriptor(), name.c_str(), 0));
  }
  close();
}

void LockedFile::close() {
  if (descriptor_ < 0) return;
  if (strike_off(descriptor_)) {
    // A child that was forked just now may not have closed its copy yet.
    ::flock(descriptor_, LOCK_UN);
    ::close(descriptor_);
  }
  descriptor_ = -1;
}

}  // namespace gimnet::nif
