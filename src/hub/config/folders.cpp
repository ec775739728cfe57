#include "hub/config/folders.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>

#include "base/descriptor.hpp"
#include "base/runtime_folder.hpp"

namespace gimnet::hub {
namespace {

constexpr mode_t kPrivateFolder = 0700;

constexpr const char* kElsewhere = "name another place";
constexpr const char* kStateElsewhere = "name another place with --state-dir";

/// The remedy for a folder that cannot be made or looked at; `elsewhere` always is one.
std::string remedy_of_folder(int error, const std::string& path, const std::string& elsewhere) {
  const std::size_t slash = path.rfind('/');
  const std::string above = slash == std::string::npos ? "."
                            : slash == 0               ? "/"
                                                       : path.substr(0, slash);
  // There are folders in which nothing can be made: /proc.
  if (error == ENOENT && ::access(above.c_str(), F_OK) != 0)
    return "; make " + above + " first, or " + elsewhere;
  if (error == ENOTDIR) return "; a part of " + above + " is no folder: " + elsewhere;
  if (error == ENAMETOOLONG) return "; " + elsewhere + ", with a shorter path";
  if (error == EACCES)
    return "; run tcphub as a user that may write to " + above + ", or " + elsewhere;
  return "; " + elsewhere;
}

/// "" when there is something at `path` then; `info` describes it.
std::string make_folder(const std::string& path, struct stat& info,
                        const char* elsewhere = kElsewhere) {
  if (::mkdir(path.c_str(), kPrivateFolder) != 0 && errno != EEXIST) {
    const int error = errno;
    return "cannot create the folder " + path + ": " + system_text(error) +
           remedy_of_folder(error, path, elsewhere);
  }
  if (::lstat(path.c_str(), &info) != 0) {
    const int error = errno;
    return "cannot use the folder " + path + ": " + system_text(error) +
           remedy_of_folder(error, path, elsewhere);
  }
  return {};
}

}  // namespace

std::string prepare_private_folder(const std::string& path) {
  struct stat info{};
  if (std::string error = make_folder(path, info); !error.empty()) return error;
  if (!S_ISDIR(info.st_mode)) return "cannot use " + path + ": it is not a folder; remove it";
  if (info.st_uid != ::geteuid()) {
    return "cannot use the folder " + path +
           ": it belongs to another user, who could put his own socket in its place";
  }
  if ((info.st_mode & 0077) != 0) {
    return "cannot use the folder " + path + ": other users have rights in it; chmod 700 " + path;
  }
  // As whoever the process acts for, like the bind() that follows. Root may anything, but where all
  // is read-only.
  if (::faccessat(AT_FDCWD, path.c_str(), W_OK | X_OK, AT_EACCESS) != 0) {
    const std::string remedy = errno == EACCES ? "; chmod 700 " + path : "";
    return "cannot use the folder " + path + ": nothing can be put into it: " + system_text(errno) +
           remedy;
  }
  return {};
}

Result<std::string> runtime_folder() {
  const std::string path = runtime_folder_of_user().path();
  if (std::string error = prepare_private_folder(path); !error.empty()) return Error{error};
  return path;
}

std::vector<std::string> default_addresses() {
  return {"tcp://127.0.0.1:7450", "unix:" + runtime_folder_of_user().path() + "/tcphub.sock"};
}

std::string prepare_state_folder(const std::string& path) {
  struct stat info{};
  if (std::string error = make_folder(path, info, kStateElsewhere); !error.empty()) return error;
  if (S_ISLNK(info.st_mode) && ::stat(path.c_str(), &info) != 0) {
    return "cannot use the folder " + path + ": it is a link, and " + system_text(errno) +
           "; remove it, or " + kStateElsewhere;
  }
  if (!S_ISDIR(info.st_mode)) {
    return "cannot use " + path + " for state: it is not a folder; remove it, or " +
           kStateElsewhere;
  }
  if (info.st_uid != ::geteuid()) {
    return "cannot use the folder " + path +
           " for state: it belongs to another user, who could put other files into it; run tcphub "
           "as that user, or " +
           kStateElsewhere;
  }
  if ((info.st_mode & 0022) != 0) {
    return "cannot use the folder " + path +
           " for state: other users may write to it; chmod go-w " + path;
  }
  if (::access(path.c_str(), R_OK | W_OK | X_OK) != 0) {
    return "cannot use the folder " + path + " for state: " + system_text(errno) +
           "; run tcphub as the user that may write there, or give it another one with --state-dir";
  }
  return {};
}

Result<std::string> default_state_folder(const std::string& name) {
  const auto absolute = [](const char* variable) {
    const char* value = std::getenv(variable);
    return std::string{value != nullptr && *value == '/' ? value : ""};
  };
  // Of systemd's list the first; it makes that one itself.
  std::string path = absolute("STATE_DIRECTORY");
  path = path.substr(0, path.find(':'));
  if (!path.empty()) return path + "/" + name;
  path = absolute("XDG_STATE_HOME");
  std::vector<const char*> parts{"", "/gimnet"};
  if (path.empty()) {
    path = absolute("HOME");
    parts = {"/.local", "/state", "/gimnet"};
  }
  if (path.empty()) return Error{"neither XDG_STATE_HOME nor HOME is set"};
  struct stat info{};
  // Folders that root creates in the home of a user are of no use to that user.
  if (::geteuid() == 0 && ::stat(path.c_str(), &info) == 0 && info.st_uid != 0)
    return Error{path + " belongs to another user"};
  for (const char* part : parts) {
    path += part;
    if (std::string error = make_folder(path, info); !error.empty()) return Error{std::move(error)};
  }
  return path + "/" + name;
}

}  // namespace gimnet::hub
