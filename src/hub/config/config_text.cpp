#include "hub/config/config_text.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>

#include "base/clock.hpp"
#include "base/descriptor.hpp"
#include "hub/config/toml_file.hpp"

namespace gimnet::hub {
namespace {

using std::chrono::milliseconds;

constexpr const char* kGivePath =
    "give the path of a TOML file with --config, or, in conf.d, take it away";

ConfigText no_text(int code) {
  const std::error_code error{code, std::generic_category()};
  const bool denied = error == std::errc::permission_denied;
  return {{},
          error.message() +
              remedy_of(error, denied ? "give the user that runs tcphub the right to read it"
                                      : kGivePath)};
}

/// What stands there instead of a file, or "".
std::string instead_of_file(const struct stat& info, bool pipes) {
  const std::string remedy = std::string{"; "} + kGivePath;
  if (S_ISREG(info.st_mode) || (pipes && S_ISFIFO(info.st_mode))) return {};
  if (S_ISDIR(info.st_mode)) return "it is a folder" + remedy;
  if (S_ISSOCK(info.st_mode)) return "it is a socket" + remedy;
  if (S_ISFIFO(info.st_mode)) {
    return "it is a pipe, which only a hub that starts can read, as the file of --config; put a "
           "regular file in its "
           "place";
  }
  // The usual word for "no file".
  if (S_ISCHR(info.st_mode) && info.st_rdev == makedev(1, 3)) return {};
  return "it is a device" + remedy;
}

/// Reads what is there, at most one byte more than a configuration may have. 0: the end, EAGAIN:
/// the rest is not there yet, or another error.
int read_more(int descriptor, std::string& text) {
  while (text.size() <= kConfigBytesMax) {
    const std::size_t before = text.size();
    const std::size_t wanted = std::min<std::size_t>(kConfigBytesMax + 1 - before, 64 * 1024);
    text.resize(before + wanted);
    const ssize_t got = ::read(descriptor, text.data() + before, wanted);
    text.resize(before + static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
    if (got == 0) return 0;
    if (got < 0 && errno != EINTR) return errno;
  }
  return 0;
}

ConfigText read_pipe(int descriptor, milliseconds patience) {
  ConfigText file;
  const std::int64_t until = steady_now_ns() + patience.count() * 1'000'000;
  const std::string remedy = "; write the configuration into it and close it, or give a file";
  for (;;) {
    const int error = read_more(descriptor, file.text);
    if (error != 0 && error != EAGAIN) return no_text(error);
    // Before the first writer has come its end looks as after the last one has left.
    if (error == 0 && !file.text.empty()) return file;
    const std::int64_t left_ns = until - steady_now_ns();
    if (left_ns <= 0) {
      std::string why = error == 0 ? "nobody wrote into this pipe" : "this pipe did not end";
      why += " within " + std::to_string(patience.count()) + " ms";
      return {{}, why + remedy};
    }
    pollfd wait{descriptor, POLLIN, 0};
    const int events = ::poll(&wait, 1, static_cast<int>(left_ns / 1'000'000 + 1));
    if (events > 0 && (wait.revents & POLLIN) == 0 && file.text.empty())
      return {{}, "this pipe is empty" + remedy};
  }
}

}  // namespace

std::string remedy_of(const std::error_code& error, const std::string& otherwise) {
  const bool shortage =
      error == std::errc::too_many_files_open || error == std::errc::too_many_files_open_in_system;
  if (!shortage) return "; " + otherwise;
  return "; there is no descriptor left to read it with: raise the limit (ulimit -n) or let a node "
         "go, then try again";
}

ConfigText read_config_text(const std::string& path, milliseconds pipe_patience) {
  const bool pipes = pipe_patience > milliseconds{0};
  struct stat info{};
  // Before it is opened: that may already do something to a device, or to who waits to write into a
  // pipe.
  if (::stat(path.c_str(), &info) != 0) return no_text(errno);
  if (std::string error = instead_of_file(info, pipes); !error.empty())
    return {{}, std::move(error)};
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC));
  if (file.get() < 0 || ::fstat(file.get(), &info) != 0) return no_text(errno);
  // Something else may have taken its place.
  if (std::string error = instead_of_file(info, pipes); !error.empty())
    return {{}, std::move(error)};
  if (S_ISFIFO(info.st_mode)) return read_pipe(file.get(), pipe_patience);
  ConfigText whole;
  const int error = read_more(file.get(), whole.text);
  return error == 0 ? whole : no_text(error);
}

}  // namespace gimnet::hub
