#include "tools/demo/child_process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>
#include <utility>

#include "base/clock.hpp"

namespace gimnet::demo {
namespace {

constexpr std::int64_t kMillisecond_ns = 1'000'000;
constexpr std::size_t kLineMax = 4096;

// Between fork and exec: only what POSIX allows there. Never returns.
[[noreturn]] void become(char* const* words, int output, int errors, pid_t parent) {
  // A parent that died before this line would never be noticed.
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::_exit(126);
  ::setpgid(0, 0);
  const int nothing = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  if (nothing >= 0) ::dup2(nothing, STDIN_FILENO);
  ::dup2(output, STDOUT_FILENO);
  if (errors >= 0) ::dup2(errors, STDERR_FILENO);
  struct sigaction action{};
  action.sa_handler = SIG_DFL;
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) ::sigaction(signal, &action, nullptr);
  ::execv(words[0], words);
  const char* reason = ::strerrordesc_np(errno);
  (void)!::write(STDERR_FILENO, reason, std::strlen(reason));
  ::_exit(127);
}

int exit_status(int status) {
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace

Result<ChildProcess> ChildProcess::start(Command command) {
  const std::string& path = command.words.front();
  if (::access(path.c_str(), X_OK) != 0) {
    return Error{fmt::format("cannot start {}: {}: {}; build it with ./dev build", command.title,
                             path, std::strerror(errno))};
  }
  int pipe_ends[2];
  if (::pipe2(pipe_ends, O_CLOEXEC) != 0) {
    return Error{fmt::format("cannot start {}: no pipe: {}", command.title, std::strerror(errno))};
  }
  const int errors =
      ::open(command.log_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  std::vector<char*> words;
  words.reserve(command.words.size() + 1);
  for (std::string& word : command.words) words.push_back(word.data());
  words.push_back(nullptr);
  const pid_t parent = ::getpid();
  const pid_t id = ::fork();
  if (id == 0) become(words.data(), pipe_ends[1], errors, parent);
  const int fork_error = errno;
  ::close(pipe_ends[1]);
  if (errors >= 0) ::close(errors);
  if (id < 0) {
    ::close(pipe_ends[0]);
    return Error{
        fmt::format("cannot start {}: no process: {}", command.title, std::strerror(fork_error))};
  }
  ChildProcess child;
  child.command_ = std::move(command);
  child.id_ = id;
  child.output_ = pipe_ends[0];
  return child;
}

ChildProcess::ChildProcess(ChildProcess&& other) noexcept
    : command_(std::move(other.command_)),
      id_(std::exchange(other.id_, -1)),
      output_(std::exchange(other.output_, -1)),
      pending_(std::move(other.pending_)),
      status_(other.status_) {}

ChildProcess& ChildProcess::operator=(ChildProcess&& other) noexcept {
  if (this == &other) return *this;
  end();
  command_ = std::move(other.command_);
  id_ = std::exchange(other.id_, -1);
  output_ = std::exchange(other.output_, -1);
  pending_ = std::move(other.pending_);
  status_ = other.status_;
  return *this;
}

std::string ChildProcess::last_words() const {
  std::ifstream file(command_.log_path);
  std::string line;
  std::string last;
  while (std::getline(file, line)) {
    if (!line.empty()) last = line;
  }
  return last.empty() ? "it said nothing" : last.substr(0, 500);
}

Result<std::string> ChildProcess::read_line(std::int64_t wait_ns) {
  const std::int64_t until_ns = steady_now_ns() + wait_ns;
  while (true) {
    const std::size_t end = pending_.find('\n');
    if (end != std::string::npos) {
      std::string line = pending_.substr(0, end);
      pending_.erase(0, end + 1);
      return line;
    }
    const std::int64_t left_ns = until_ns - steady_now_ns();
    if (left_ns <= 0 || pending_.size() > kLineMax) {
      return Error{fmt::format("{} is not ready after {} s: {}", command_.title,
                               wait_ns / 1'000'000'000, last_words())};
    }
    pollfd waiting{output_, POLLIN, 0};
    if (::poll(&waiting, 1, static_cast<int>(left_ns / kMillisecond_ns) + 1) < 0 && errno != EINTR)
      continue;
    if (waiting.revents == 0) continue;
    char buffer[512];
    const ssize_t got = ::read(output_, buffer, sizeof buffer);
    if (got > 0) {
      pending_.append(buffer, static_cast<std::size_t>(got));
    } else if (got == 0) {
      (void)wait(kPatience_ns);
      return Error{fmt::format("{} ended at once: {}", command_.title, last_words())};
    }
  }
}

std::optional<int> ChildProcess::wait(std::int64_t wait_ns) {
  const std::int64_t until_ns = steady_now_ns() + wait_ns;
  while (id_ > 0 && !status_) {
    int status = 0;
    const pid_t got = ::waitpid(id_, &status, WNOHANG);
    if (got == id_) status_ = exit_status(status);
    if (got < 0 && errno != EINTR) status_ = 0;
    if (status_ || steady_now_ns() >= until_ns) break;
    // Woken early when the child closes its standard output, which mostly means that it ends.
    pollfd waiting{output_, 0, 0};
    (void)::poll(&waiting, 1, 5);
  }
  return status_;
}

std::optional<Error> ChildProcess::ended(std::int64_t wait_ns) {
  if (!wait(wait_ns)) return std::nullopt;
  if (*status_ >= 128) {
    return Error{fmt::format("{} was ended by signal {} ({}); its last words: {}", command_.title,
                             *status_ - 128, ::strsignal(*status_ - 128), last_words())};
  }
  return Error{
      fmt::format("{} ended by itself with status {}: {}", command_.title, *status_, last_words())};
}

void ChildProcess::end() {
  if (id_ > 0 && !wait(0)) {
    (void)::kill(id_, SIGTERM);
    if (!wait(kPatience_ns)) {
      (void)::kill(id_, SIGKILL);
      (void)wait(kPatience_ns);
    }
  }
  if (output_ >= 0) ::close(output_);
  output_ = -1;
  id_ = -1;
}

}  // namespace gimnet::demo
