#include "tests/client/gimi/support/hub_process.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>

extern char** environ;

namespace gimnet::test {
namespace {

/// The first line of a pipe, without its newline; what came by then if it ends or takes too long.
std::string read_line(int descriptor) {
  std::string line;
  char letter = 0;
  pollfd ready{descriptor, POLLIN, 0};
  while (::poll(&ready, 1, static_cast<int>(std::chrono::milliseconds(kPatience).count())) == 1) {
    if (::read(descriptor, &letter, 1) != 1 || letter == '\n') break;
    line += letter;
  }
  return line;
}

}  // namespace

HubProcess::HubProcess(const std::vector<std::string>& arguments) {
  std::vector<std::string> words{GIMNET_TCPHUB, "--listen", "tcp://127.0.0.1:0", "--hub-id", "7",
                                 "--placement", "hint",     "--log-level",       "off"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  std::array<int, 2> pipe{};
  if (::pipe2(pipe.data(), O_CLOEXEC) != 0) return;
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, pipe[1], STDOUT_FILENO);
  if (::posix_spawn(&process_, GIMNET_TCPHUB, &actions, nullptr, pointers.data(), environ) != 0)
    process_ = -1;
  posix_spawn_file_actions_destroy(&actions);
  ::close(pipe[1]);
  const std::string line = read_line(pipe[0]);
  ::close(pipe[0]);
  constexpr std::string_view kReady = "ready ";
  EXPECT_TRUE(line.starts_with(kReady)) << "tcphub said: " << line;
  if (line.starts_with(kReady))
    url_ = line.substr(kReady.size(), line.find(' ', kReady.size()) - kReady.size());
}

void HubProcess::kill() {
  if (process_ < 0) return;
  ::kill(process_, SIGKILL);
  ::waitpid(process_, nullptr, 0);
  process_ = -1;
}

}  // namespace gimnet::test
