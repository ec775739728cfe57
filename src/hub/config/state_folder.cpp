#include "hub/config/state_folder.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <span>
#include <vector>

#include "base/descriptor.hpp"
#include "base/log.hpp"
#include "base/random.hpp"
#include "hub/config/folders.hpp"
#include "hub/control/port_owner.hpp"

namespace gimnet::hub {
namespace {

constexpr mode_t kPrivateFile = 0600;
constexpr const char* kState = "state";
constexpr const char* kFresh = "state.new";
constexpr const char* kLock = "lock";
constexpr const char* kMakeWritable = "; make the folder one that tcphub may write to";
constexpr const char* kBeginAnew =
    "; put a copy of it back, or move it away: the hub then begins anew, and nodes get new ids";
constexpr const char* kOtherFolder =
    "; run tcphub as the user whose it is, or give it another folder with --state-dir";

/// Why a file of the folder cannot be opened, and what to do; `otherwise` where the error tells
/// nothing special.
std::string open_fault(int error, const std::string& otherwise) {
  if (error == ELOOP)
    return "it is a link, and links are not followed; put a file in its place, or remove it";
  if (error == EISDIR) return "it is a folder; remove it";
  if (error == ENXIO) return "it is not a file; remove it";
  return system_text(error) + (error == EACCES ? kOtherFolder : otherwise);
}

/// "" for a regular file of this user into which nobody else may look, or why it is none.
std::string private_file_fault(int descriptor, const std::string& path) {
  struct stat info{};
  if (::fstat(descriptor, &info) != 0) return system_text(errno);
  if (!S_ISREG(info.st_mode)) return "it is not a file; remove it";
  if (info.st_uid != ::geteuid())
    return "it belongs to another user; run tcphub as that user, or give it --state-dir";
  if ((info.st_mode & 0077) != 0) return "other users have rights in it; chmod 600 " + path;
  return {};
}

/// The process that wrote its number into the lock file; 0: none did.
pid_t holder_of(int lock) {
  std::array<char, 16> text{};
  const ssize_t size = ::pread(lock, text.data(), text.size(), 0);
  pid_t process = 0;
  if (size > 0) static_cast<void>(std::from_chars(text.data(), text.data() + size, process));
  return process;
}

void write_holder(int lock) {
  const std::string text = std::to_string(::getpid()) + "\n";
  // For the words of the one who finds the lock held; it holds without them.
  if (::ftruncate(lock, 0) == 0) static_cast<void>(!::pwrite(lock, text.data(), text.size(), 0));
}

/// At most one byte more than is legal, so that longer ones show. Nothing: `error` says why.
std::optional<std::vector<std::byte>> read_all(int descriptor, int& error) {
  std::vector<std::byte> bytes(kHubStateBytesMax + 1);
  std::size_t size = 0;
  while (size < bytes.size()) {
    const ssize_t count = ::read(descriptor, bytes.data() + size, bytes.size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) {
      error = errno;
      return std::nullopt;
    }
    if (count == 0) break;
    size += static_cast<std::size_t>(count);
  }
  bytes.resize(size);
  return bytes;
}

bool write_all(int descriptor, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(descriptor, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

std::string write_fault(const std::string& path, const char* what, int error) {
  std::string remedy = kMakeWritable;
  if (error == ENOSPC || error == EDQUOT) remedy = "; free space there";
  if (error == EFBIG) remedy = "; allow tcphub larger files (ulimit -f, LimitFSIZE=)";
  if (error == EISDIR) remedy = "; it is a folder: remove it";
  return "cannot write the hub's state to " + path + "/" + kState + " (" + what +
         "): " + system_text(error) + remedy;
}

Error in_use(const std::string& path, int lock) {
  const pid_t holder = holder_of(lock);
  return Error{"the state folder " + path + " is in use by " +
               (holder > 0 ? process_text(holder) : "another hub") +
               "; end that, or give this hub a folder of its own with --state-dir"};
}

}  // namespace

Result<std::unique_ptr<StateFolder>> StateFolder::open(const std::string& path) {
  if (std::string error = prepare_state_folder(path); !error.empty())
    return Error{std::move(error)};
  Descriptor folder(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder.is_open())
    return Error{"cannot use the folder " + path +
                 " for state: " + open_fault(errno, kOtherFolder)};
  const std::string name = path + "/" + kLock;
  Descriptor lock(
      ::openat(folder.get(), kLock, O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, kPrivateFile));
  if (!lock.is_open()) return Error{"cannot use " + name + ": " + open_fault(errno, kOtherFolder)};
  if (const std::string fault = private_file_fault(lock.get(), name); !fault.empty()) {
    return Error{"cannot use " + name + ": " + fault};
  }
  if (::flock(lock.get(), LOCK_EX | LOCK_NB) != 0) {
    if (errno == EWOULDBLOCK) return in_use(path, lock.get());
    return Error{"cannot lock " + name + ": " + system_text(errno) +
                 "; give tcphub a folder on a disk of this machine with --state-dir"};
  }
  // A hub that kept something left its number in the file.
  struct stat info{};
  static_cast<void>(::fstat(lock.get(), &info));
  const bool was_used =
      info.st_size > 0 || ::faccessat(folder.get(), kState, F_OK, AT_SYMLINK_NOFOLLOW) == 0;
  write_holder(lock.get());
  return std::unique_ptr<StateFolder>(
      new StateFolder(path, folder.release(), lock.release(), was_used));
}

StateFolder::~StateFolder() {
  // No hub was here: the next one must not believe that what a hub kept is lost.
  if (!was_used_ && !kept_) static_cast<void>(!::ftruncate(lock_, 0));
  ::close(lock_);
  ::close(folder_);
}

Result<std::optional<HubState>> StateFolder::read() const {
  const std::string name = path_ + "/" + kState;
  const Descriptor file(::openat(folder_, kState, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  if (!file.is_open()) {
    if (errno == ENOENT) return std::optional<HubState>{};
    return Error{"cannot read " + name + ": " + open_fault(errno, kBeginAnew)};
  }
  if (const std::string fault = private_file_fault(file.get(), name); !fault.empty()) {
    return Error{"cannot use " + name + ": " + fault};
  }
  int error = 0;
  const std::optional<std::vector<std::byte>> bytes = read_all(file.get(), error);
  if (!bytes) return Error{"cannot read " + name + ": " + system_text(error) + kBeginAnew};
  Result<HubState> state = read_hub_state(*bytes);
  if (!state) {
    return Error{"cannot use " + name + ": " + state.error().sentence + kBeginAnew};
  }
  return std::optional{std::move(*state)};
}

std::string StateFolder::write(const HubState& state) {
  bool created = false;
  const auto failed = [&](const char* what) {
    const int error = errno;
    if (created) static_cast<void>(::unlinkat(folder_, kFresh, 0));  // nobody needs the part of it
    return write_fault(path_, what, error);
  };
  // A file left over by a crash, or a link that somebody put there: never written through.
  if (::unlinkat(folder_, kFresh, 0) != 0 && errno != ENOENT) {
    const std::string why =
        errno == EISDIR ? "it is a folder; remove it" : system_text(errno) + kMakeWritable;
    return "cannot write the hub's state: " + path_ + "/" + kFresh + " is in the way: " + why;
  }
  const Descriptor file(::openat(
      folder_, kFresh, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, kPrivateFile));
  if (!file.is_open()) return failed("create");
  created = true;
  if (!write_all(file.get(), write_hub_state(state))) return failed("write");
  if (::fsync(file.get()) != 0) return failed("fsync");
  if (::renameat(folder_, kFresh, folder_, kState) != 0) return failed("rename");
  created = false;
  kept_ = true;
  if (::fsync(folder_) != 0) return failed("fsync the folder");
  return {};
}

namespace {

/// Any index. An earlier hub with n nodes had one of the first m with a chance of (n + m) / 2^20;
/// it would be 1/256 if blocks began at their multiples only.
std::uint32_t random_mark() { return 1 + static_cast<std::uint32_t>(random_bits() % kIndexMost); }

/// `known_first`: there was no hub before whose nodes might still come back.
HubState new_state(bool known_first) {
  HubState state;
  fill_randomly(state.secret);
  fill_randomly(state.unique_id);
  if (!known_first) {
    state.node_mark = random_mark();
    state.group_mark = random_mark();
  }
  return state;
}

void draw_if_needed(HubState& state, const StateWish& wish) {
  if (wish.drawn != kOwnHub) state.drawn_hub = wish.drawn;
  if (!wish.draws_hub || state.drawn_hub != kOwnHub) return;
  state.drawn_hub = draw_hub(random_bits(), [](HubId) { return false; });
  log_info("the hub drew hub id " + std::to_string(state.drawn_hub.value()) +
           ", since it links to others and none is configured; hub_id = N sets one");
}

StartState in_memory(bool known_first, const StateWish& wish) {
  StartState result;
  result.start.state = new_state(known_first);
  draw_if_needed(result.start.state, wish);
  result.start.state.boot = 1;
  result.start.nodes.first = result.start.state.node_mark;
  result.start.groups.first = result.start.state.group_mark;
  result.instance = proto::HubInstance{random_bits()};
  return result;
}

Result<StartState> go_on_from(std::unique_ptr<StateFolder> folder,
                              const std::optional<HubState>& found, const StateWish& wish) {
  if (!found && folder->was_used()) {
    log_warning("there is no state in " + folder->path() +
                " any more: the hub begins anew, and nodes that come back get new ids");
  }
  Result<HubStart> start = next_start(found ? *found : new_state(!folder->was_used()), wish.wall);
  if (!start)
    return Error{"cannot go on from " + folder->path() + "/state: " + start.error().sentence};
  draw_if_needed(start->state, wish);
  if (const std::string error = folder->write(start->state); !error.empty()) return Error{error};
  return StartState{std::move(*start), proto::HubInstance{random_bits()}, std::move(folder)};
}

bool is_there(const std::string& path) {
  struct stat info{};
  return ::lstat(path.c_str(), &info) == 0 || errno != ENOENT;
}

StartState without_folder(const std::string& why, const StateWish& wish) {
  log_warning("the hub keeps nothing over a restart (" + why +
              "): nodes then get new ids; --state-dir DIR names a folder for its state");
  return in_memory(false, wish);
}

}  // namespace

std::string state_folder_name(const ListenUrl& address) {
  const bool tcp = address.scheme == ListenUrl::Scheme::tcp;
  if (tcp && address.port == 0) return {};
  std::string name = "hub-";
  for (const char c :
       tcp ? "tcp-" + address.host + "-" + std::to_string(address.port) : "unix" + address.path) {
    const bool plain =
        std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.' || c == '-' || c == '_';
    name += plain ? c : (c == '/' ? '-' : '_');
  }
  return name;
}

Result<StartState> start_state(const StateWish& wish) {
  const bool asked_for = !wish.folder.empty();
  std::string path = wish.folder;
  if (!asked_for) {
    const std::string name = state_folder_name(wish.address);
    if (name.empty()) return in_memory(true, wish);
    const Result<std::string> place = default_state_folder(name);
    if (!place) return without_folder(place.error().sentence, wish);
    path = *place;
  }
  // A folder that was there may hold what another hub lives on, or what this one has to go on from.
  const bool was_there = is_there(path);
  auto folder = StateFolder::open(path);
  if (!folder) {
    if (asked_for || was_there) return folder.error();
    return without_folder(folder.error().sentence, wish);
  }
  const auto found = (*folder)->read();
  if (!found) return found.error();
  const bool was_used = (*folder)->was_used();
  Result<StartState> result = go_on_from(std::move(*folder), *found, wish);
  if (result || asked_for || *found || was_used) return result;
  return without_folder(result.error().sentence, wish);
}

}  // namespace gimnet::hub
