#include "tools/demo/own_network.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <system_error>

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
  return ChildProcess({std::move(command), id, pipe_ends[0], {}, {}});
}

std::string ChildProcess::last_words() const {
  std::ifstream file(state_->command.log_path);
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
    const std::size_t end = state_->pending.find('\n');
    if (end != std::string::npos) {
      std::string line = state_->pending.substr(0, end);
      state_->pending.erase(0, end + 1);
      return line;
    }
    const std::int64_t left_ns = until_ns - steady_now_ns();
    if (left_ns <= 0 || state_->pending.size() > kLineMax) {
      return Error{fmt::format("{} is not ready after {} s: {}", state_->command.title,
                               wait_ns / 1'000'000'000, last_words())};
    }
    pollfd waiting{state_->output, POLLIN, 0};
    if (::poll(&waiting, 1, static_cast<int>(left_ns / kMillisecond_ns) + 1) < 0 && errno != EINTR)
      continue;
    if (waiting.revents == 0) continue;
    char buffer[512];
    const ssize_t got = ::read(state_->output, buffer, sizeof buffer);
    if (got > 0) {
      state_->pending.append(buffer, static_cast<std::size_t>(got));
    } else if (got == 0) {
      (void)wait(kPatience_ns);
      return Error{fmt::format("{} ended at once: {}", state_->command.title, last_words())};
    }
  }
}

std::optional<int> ChildProcess::wait(std::int64_t wait_ns) {
  const std::int64_t until_ns = steady_now_ns() + wait_ns;
  while (!state_->status) {
    int status = 0;
    const pid_t got = ::waitpid(state_->id, &status, WNOHANG);
    if (got == state_->id) state_->status = exit_status(status);
    if (got < 0 && errno != EINTR) state_->status = 0;
    if (state_->status || steady_now_ns() >= until_ns) break;
    // Woken early when the child closes its standard output, which mostly means that it ends.
    pollfd waiting{state_->output, 0, 0};
    (void)::poll(&waiting, 1, 5);
  }
  return state_->status;
}

std::optional<Error> ChildProcess::ended(std::int64_t wait_ns) {
  if (!wait(wait_ns)) return std::nullopt;
  if (*state_->status >= 128) {
    return Error{fmt::format("{} was ended by signal {} ({}); its last words: {}",
                             state_->command.title, *state_->status - 128,
                             ::strsignal(*state_->status - 128), last_words())};
  }
  return Error{fmt::format("{} ended by itself with status {}: {}", state_->command.title,
                           *state_->status, last_words())};
}

void ChildProcess::end() {
  if (!state_) return;
  if (!wait(0)) {
    (void)::kill(state_->id, SIGTERM);
    if (!wait(kPatience_ns)) {
      (void)::kill(state_->id, SIGKILL);
      (void)wait(kPatience_ns);
    }
  }
  ::close(state_->output);
  state_.reset();
}

namespace {

// The path of a Unix socket has 107 bytes; the longest name in the folder takes 20 of them.
constexpr std::size_t kParentMax = 70;

}  // namespace

Result<TemporaryFolder> TemporaryFolder::make() {
  const char* given = std::getenv("TMPDIR");
  std::string parent = given != nullptr && *given != '\0' ? given : "/tmp";
  if (parent.size() > kParentMax) parent = "/tmp";
  std::string path = parent + "/gimnet-demo.XXXXXX";
  if (::mkdtemp(path.data()) == nullptr) {
    return Error{
        fmt::format("cannot make a folder in {}: {}; set TMPDIR to a place that can be written",
                    parent, std::strerror(errno))};
  }
  return TemporaryFolder(path);
}

void TemporaryFolder::Remover::operator()(const std::string* path) const {
  std::error_code ignored;
  std::filesystem::remove_all(*path, ignored);
  delete path;
}

namespace {

constexpr std::int64_t kReady_ns = 15'000'000'000;

std::vector<std::string> robot_words(const DemoOptions& options, const std::string& program,
                                     const std::string& hub_url) {
  std::vector<std::string> words = {program, "robot", "--hub", hub_url, "--robot", options.robot};
  if (!options.map.empty()) words.insert(words.end(), {"--map", options.map});
  if (!options.log.empty()) {
    words.insert(words.end(), {"--log", options.log, "--speed", fmt::format("{}", options.speed)});
  }
  return words;
}

}  // namespace

Result<HubAddresses> parse_ready_line(const std::string& line) {
  std::istringstream words(line);
  std::string word;
  HubAddresses addresses;
  if (words >> word && word == "ready") {
    while (words >> word) {
      if (word.starts_with("tcp://")) addresses.tcp = word;
      if (word.starts_with("unix:")) addresses.unix_socket = word;
    }
  }
  if (addresses.tcp.empty() || addresses.unix_socket.empty()) {
    return Error{fmt::format(
        "the hub said '{}' instead of 'ready' and its addresses; is it another version?", line)};
  }
  return addresses;
}

Result<HubProcess> start_hub(const std::string& programs, const TemporaryFolder& folder,
                             const HubWish& wish) {
  std::vector<std::string> words{programs + "/tcphub",
                                 "--listen",
                                 "tcp://127.0.0.1:0",
                                 "--listen",
                                 "unix:" + (folder / (wish.name + ".sock")),
                                 "--state-dir",
                                 folder / wish.name};
  words.insert(words.end(), wish.more.begin(), wish.more.end());
  Result<ChildProcess> process =
      ChildProcess::start({wish.title, words, folder / (wish.name + ".log")});
  if (!process) return process.error();
  const Result<std::string> ready = process->read_line(kReady_ns);
  if (!ready) return ready.error();
  const Result<HubAddresses> at = parse_ready_line(*ready);
  if (!at) return at.error();
  return HubProcess{std::move(*process), *at};
}

std::string folder_of_this_program() {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  return error ? "." : program.parent_path().string();
}

Result<OwnNetwork> OwnNetwork::start(const DemoOptions& options,
                                     const std::string& folder_of_programs) {
  Result<TemporaryFolder> folder = TemporaryFolder::make();
  if (!folder) return folder.error();
  Result<HubProcess> hub = start_hub(folder_of_programs, *folder, {"the hub", "hub"});
  if (!hub) return hub.error();
  const std::string robot_log = *folder / "robot.log";
  OwnNetwork network(std::move(*folder), std::move(hub->process));
  network.hub_url_ = hub->at.tcp;
  Result<ChildProcess> robot = ChildProcess::start(
      {"the robot", robot_words(options, folder_of_programs + "/gimnet-demo", hub->at.unix_socket),
       robot_log});
  if (!robot) return robot.error();
  network.robot_.emplace(std::move(*robot));
  const Result<std::string> there = network.robot_->read_line(kReady_ns);
  if (!there) return there.error();
  return network;
}

std::optional<Error> OwnNetwork::trouble(std::int64_t wait_ns) {
  if (std::optional<Error> error = hub_.ended(wait_ns)) return error;
  return robot_ ? robot_->ended() : std::nullopt;
}

}  // namespace gimnet::demo
