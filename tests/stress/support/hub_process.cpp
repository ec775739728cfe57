#include "tests/stress/support/hub_process.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/size.hpp"
#include "tests/stress/support/statistics.hpp"

namespace gimnet::stress {
namespace {

struct Started {
  pid_t pid = -1;
  Descriptor output;
};

Started start(const std::vector<std::string>& arguments) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error("pipe2");
  std::string program = GIMNET_TCPHUB;
  std::vector<char*> argv{program.data()};
  std::vector<std::string> copies = arguments;
  for (std::string& argument : copies) argv.push_back(argument.data());
  argv.push_back(nullptr);
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent) ::_exit(1);
    ::dup2(ends[1], STDOUT_FILENO);
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  ::close(ends[1]);
  if (child < 0) throw std::runtime_error("fork");
  return {child, Descriptor(ends[0])};
}

/// Reads up to a newline, or to the end if there is none.
std::string read_output(int descriptor, bool to_the_end) {
  std::string text;
  const Deadline deadline;
  while (to_the_end || text.find('\n') == std::string::npos) {
    deadline.check("output of tcphub");
    wait_readable({descriptor}, 100);
    pollfd polled{descriptor, POLLIN, 0};
    if (::poll(&polled, 1, 0) <= 0) continue;
    std::array<char, 4096> bytes{};
    const ssize_t size = ::read(descriptor, bytes.data(), bytes.size());
    if (size <= 0) break;
    text.append(bytes.data(), static_cast<std::size_t>(size));
  }
  return text;
}

}  // namespace

HubProcess::HubProcess(const std::vector<std::string>& arguments) {
  std::string pattern = (std::filesystem::temp_directory_path() / "gimnet-stress-XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("mkdtemp");
  folder_ = pattern;
  tcp_url_ = "tcp://127.0.0.1:0";
  unix_url_ = "unix:" + folder_ + "/hub";
  arguments_ = arguments;
  launch();
}

void HubProcess::kill_and_restart() {
  ::kill(pid_, SIGKILL);
  ::waitpid(pid_, nullptr, 0);
  launch();
}

void HubProcess::launch() {
  std::vector<std::string> all{"--listen",    tcp_url_,           "--listen",    unix_url_,
                               "--state-dir", folder_ + "/state", "--log-level", "error"};
  all.insert(all.end(), arguments_.begin(), arguments_.end());
  Started started = start(all);
  pid_ = started.pid;
  output_ = std::move(started.output);
  std::istringstream line(read_output(output_.get(), false));
  std::string ready;
  if (!(line >> ready >> tcp_url_ >> unix_url_) || ready != "ready")
    throw std::runtime_error("tcphub is not ready");
}

void HubProcess::expect_exact_ledger() noexcept {
  try {
    if (!is_running()) throw std::runtime_error("it ended by itself");
    // Also where it is full: who administers it always gets in.
    JoinOptions options;
    options.hello.role = proto::Role::admin;
    RawNode observer(unix_url_, options);
    static_cast<void>(wait_for_exact_ledger(observer));
  } catch (const std::exception& error) {
    ADD_FAILURE() << "tcphub at the end of the test: " << error.what();
  }
}

HubProcess::~HubProcess() {
  expect_exact_ledger();
  if (pid_ > 0) {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

bool HubProcess::is_running() {
  if (pid_ > 0 && ::waitpid(pid_, nullptr, WNOHANG) == pid_) pid_ = -1;
  return pid_ > 0;
}

std::int64_t HubProcess::resident_bytes() const {
  std::ifstream status("/proc/" + std::to_string(pid_) + "/status");
  for (std::string word; status >> word;) {
    std::int64_t kibibytes = 0;
    if (word == "VmRSS:" && status >> kibibytes) return kibibytes * 1024;
  }
  throw std::runtime_error("tcphub is gone");
}

std::string output_of_tcphub(const std::vector<std::string>& arguments) {
  const Started started = start(arguments);
  std::string text = read_output(started.output.get(), true);
  ::waitpid(started.pid, nullptr, 0);
  return text;
}

}  // namespace gimnet::stress
