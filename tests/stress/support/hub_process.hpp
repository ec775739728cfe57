#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/stress/support/socket.hpp"

namespace gimnet::stress {

/// The shipped tcphub as a process of its own, on a free port and a Unix socket in a new temporary
/// folder. Ended and cleaned up when this goes; it dies with the test program, too. In the end it
/// has to be alive and to have an exact ledger: else the test fails. Thread safety: none.
class HubProcess {
 public:
  /// `arguments` beside the addresses, for example {"--shards", "2"}. Returns when the hub is
  /// ready.
  explicit HubProcess(const std::vector<std::string>& arguments = {});
  HubProcess(const HubProcess&) = delete;
  HubProcess& operator=(const HubProcess&) = delete;
  ~HubProcess();

  [[nodiscard]] const std::string& tcp_url() const { return tcp_url_; }
  [[nodiscard]] const std::string& unix_url() const { return unix_url_; }
  [[nodiscard]] pid_t pid() const { return pid_; }
  /// Ends the hub as `kill -9` does and starts it anew on the same addresses, with the same state.
  void kill_and_restart();
  [[nodiscard]] bool is_running();
  /// Resident memory now.
  [[nodiscard]] std::int64_t resident_bytes() const;

 private:
  void launch();
  void expect_exact_ledger() noexcept;

  std::string folder_;
  std::vector<std::string> arguments_;
  std::string tcp_url_;
  std::string unix_url_;
  pid_t pid_ = -1;
  Descriptor output_;
};

/// Runs the program with these arguments and returns its standard output.
[[nodiscard]] std::string output_of_tcphub(const std::vector<std::string>& arguments);

}  // namespace gimnet::stress
