#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/result.hpp"

namespace gimnet::demo {

/// A program that this one started and ends: with it at the latest, even if it crashes. It gets a
/// process group of its own, so that Ctrl-C in a terminal does not reach it. Its standard input is
/// empty, its standard error goes to a file. Thread safety: one thread; start children from the
/// main thread only, whose end ends them.
class ChildProcess {
 public:
  /// What to start.
  struct Command {
    /// What people call it.
    std::string title;
    /// Path and arguments.
    std::vector<std::string> words;
    /// Where its standard error goes.
    std::string log_path;
  };

  /// How long a child may take to end when asked, before it is killed.
  static constexpr std::int64_t kPatience_ns = 3'000'000'000;

  /// Errors: no such program, no process to be had.
  static Result<ChildProcess> start(Command command);

  ChildProcess(ChildProcess&& other) noexcept;
  ChildProcess& operator=(ChildProcess&& other) noexcept;
  ~ChildProcess() { end(); }

  /// One line of its standard output, without the end. Errors: none within `wait_ns`, or it ended;
  /// with its last words.
  [[nodiscard]] Result<std::string> read_line(std::int64_t wait_ns);

  /// Why it ended, with its last words, if it did by itself; waits for that at most so long.
  [[nodiscard]] std::optional<Error> ended(std::int64_t wait_ns = 0);

  /// Asks it to end (SIGTERM), waits, and kills it if need be. Harmless where it has ended.
  void end();

  /// Waits until it ends by itself, at most so long. Its exit status: code, or 128 + signal;
  /// nothing if it goes on.
  [[nodiscard]] std::optional<int> wait(std::int64_t wait_ns);

  [[nodiscard]] pid_t id() const { return id_; }

 private:
  ChildProcess() = default;
  [[nodiscard]] std::string last_words() const;

  Command command_;
  pid_t id_ = -1;
  int output_ = -1;
  std::string pending_;
  std::optional<int> status_;
};

}  // namespace gimnet::demo
