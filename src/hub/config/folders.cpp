#include "hub/config/folders.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <system_error>

namespace gimnet::hub {
namespace {

constexpr mode_t kPrivate = 0700;

std::string system_text(int error) { return std::generic_category().message(error); }

/// "" when there is a folder at `path` then; `info` describes it.
std::string make_folder(const std::string& path, struct stat& info) {
  if (::mkdir(path.c_str(), kPrivate) != 0 && errno != EEXIST) {
    return "cannot create the folder " + path + ": " + system_text(errno);
  }
  if (::lstat(path.c_str(), &info) != 0) return "cannot use the folder " + path + ": " + system_text(errno);
  return {};
}

}  // namespace

std::string prepare_private_folder(const std::string& path) {
  struct stat info{};
  if (std::string error = make_folder(path, info); !error.empty()) return error;
  if (!S_ISDIR(info.st_mode)) return "cannot use " + path + ": it is not a folder; remove it";
  if (info.st_uid != ::geteuid()) {
    return "cannot use the folder " + path + ": it belongs to another user; give the socket's place with --listen";
  }
  if ((info.st_mode & 0077) != 0) {
    return "cannot use the folder " + path + ": other users have rights in it; chmod 700 " + path;
  }
  return {};
}

std::string runtime_folder_path() {
  const char* given = std::getenv("XDG_RUNTIME_DIR");
  if (given != nullptr && *given == '/') return std::string{given} + "/gimnet";
  const char* temporary = std::getenv("TMPDIR");
  return std::string{temporary != nullptr && *temporary == '/' ? temporary : "/tmp"} + "/gimnet-" +
         std::to_string(::geteuid());
}

Result<std::string> runtime_folder() {
  const std::string path = runtime_folder_path();
  if (std::string error = prepare_private_folder(path); !error.empty()) return Error{error};
  return path;
}

std::vector<std::string> default_addresses() {
  return {"tcp://127.0.0.1:7450", "unix:" + runtime_folder_path() + "/tcphub.sock"};
}

std::string prepare_state_folder(const std::string& path) {
  struct stat info{};
  if (std::string error = make_folder(path, info); !error.empty()) return error;
  if (S_ISLNK(info.st_mode) && ::stat(path.c_str(), &info) != 0) {
    return "cannot use the folder " + path + ": " + system_text(errno);
  }
  if (!S_ISDIR(info.st_mode)) return "cannot use " + path + " for --state-dir: it is not a folder";
  if (::access(path.c_str(), W_OK | X_OK) != 0) {
    return "cannot use the folder " + path + " for --state-dir: " + system_text(errno);
  }
  return {};
}

}  // namespace gimnet::hub
