#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/result.hpp"
#include "tools/demo/options.hpp"

namespace gimnet::demo {

/// A program that this one started and ends: with it at the latest, even if it crashes. It gets a
/// process group of its own, so that Ctrl-C in a terminal does not reach it. Its standard input is
/// empty, its standard error goes to a file. Thread safety: one thread; start children from the
/// main thread only, whose end ends them.
class ChildProcess {
 public:
  /// The program and its arguments.
  struct Command {
    /// Its name for people.
    std::string title;
    /// Path and arguments.
    std::vector<std::string> words;
    /// The file that takes its standard error.
    std::string log_path;
  };

  /// A child that has not ended this long after it was asked to is killed.
  static constexpr std::int64_t kPatience_ns = 3'000'000'000;

  /// Errors: no such program, no process to be had.
  static Result<ChildProcess> start(Command command);

  ChildProcess(ChildProcess&& other) noexcept = default;
  ChildProcess& operator=(ChildProcess&&) = delete;
  ~ChildProcess() { end(); }

  /// One line of its standard output, without the end. Errors: none within `wait_ns`, or it ended;
  /// with its last words.
  [[nodiscard]] Result<std::string> read_line(std::int64_t wait_ns);

  /// The reason of its end and its last words, if it ended by itself; waits at most so long.
  [[nodiscard]] std::optional<Error> ended(std::int64_t wait_ns = 0);

  /// Asks it to end (SIGTERM), waits, and kills it if need be. Harmless if it has ended.
  void end();

  /// Waits until it ends by itself, at most so long. Its exit status: code, or 128 + signal;
  /// nothing if it goes on.
  [[nodiscard]] std::optional<int> wait(std::int64_t wait_ns);

  /// REQUIRES: end() was not called.
  [[nodiscard]] pid_t id() const { return state_->id; }

 private:
  struct State {
    Command command;
    pid_t id;
    int output;
    std::string pending;
    std::optional<int> status;
  };

  explicit ChildProcess(State state) : state_(std::make_unique<State>(std::move(state))) {}
  [[nodiscard]] std::string last_words() const;

  /// Null: moved from, or ended by end().
  std::unique_ptr<State> state_;
};

/// A new folder that only this user may enter, removed with everything in it when the object goes.
class TemporaryFolder {
 public:
  /// Makes it in TMPDIR, or in /tmp. Errors: no place for it.
  static Result<TemporaryFolder> make();

  [[nodiscard]] const std::string& path() const { return *path_; }
  /// The path of something in it.
  [[nodiscard]] std::string operator/(const std::string& name) const { return *path_ + "/" + name; }

 private:
  struct Remover {
    void operator()(const std::string* path) const;
  };

  explicit TemporaryFolder(std::string path) : path_(new std::string(std::move(path))) {}

  std::unique_ptr<const std::string, Remover> path_;
};

/// The addresses in the line `ready URL URL` of a hub. Errors: another line.
struct HubAddresses {
  std::string tcp;
  std::string unix_socket;
};
[[nodiscard]] Result<HubAddresses> parse_ready_line(const std::string& line);

/// A hub that says that it is ready.
struct HubProcess {
  ChildProcess process;
  HubAddresses at;
};
/// Its files are `folder/NAME...`; `more` are further arguments.
struct HubWish {
  std::string title;
  std::string name;
  std::vector<std::string> more{};
};
/// Starts `programs`/tcphub on a free port and a Unix socket. Errors: it is missing, does not
/// start, or does not say that it is ready.
[[nodiscard]] Result<HubProcess> start_hub(const std::string& programs,
                                           const TemporaryFolder& folder, const HubWish& wish);

/// The demo's own hub and robot, each a process, with their files in a temporary folder. Ends them,
/// the robot first, when it goes. Thread safety: one thread.
class OwnNetwork {
 public:
  /// Starts a hub on a free port and a Unix socket, then a robot that connects over the socket.
  /// `folder_of_programs` holds tcphub and gimnet-demo. Errors: a program is missing, does not
  /// start, or does not say that it is ready.
  static Result<OwnNetwork> start(const DemoOptions& options,
                                  const std::string& folder_of_programs);

  /// The TCP address, to which the viewer connects.
  [[nodiscard]] const std::string& hub_url() const { return hub_url_; }

  /// A sentence about the end of hub or robot, if one of them ended by itself; waits for the hub's
  /// end at most so long.
  [[nodiscard]] std::optional<Error> trouble(std::int64_t wait_ns = 0);

 private:
  OwnNetwork(TemporaryFolder folder, ChildProcess hub)
      : folder_(std::move(folder)), hub_(std::move(hub)) {}

  // The order is that of the end: robot, hub, folder.
  TemporaryFolder folder_;
  ChildProcess hub_;
  std::optional<ChildProcess> robot_;
  std::string hub_url_;
};

/// The folder in which this program lies.
[[nodiscard]] std::string folder_of_this_program();

}  // namespace gimnet::demo
