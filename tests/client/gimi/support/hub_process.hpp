#pragma once

#include <sys/types.h>

#include <chrono>
#include <string>
#include <vector>

namespace gimnet::test {

/// A test waits for so long for an event that must come.
inline constexpr std::chrono::seconds kPatience{20};

/// A tcphub of its own on a free port of loopback, and wherever else `arguments` say. Ends with
/// this.
class HubProcess {
 public:
  explicit HubProcess(const std::vector<std::string>& arguments = {});
  ~HubProcess() { kill(); }
  HubProcess(const HubProcess&) = delete;
  HubProcess& operator=(const HubProcess&) = delete;

  /// On loopback.
  [[nodiscard]] const std::string& url() const { return url_; }
  /// Ends it without a word to anybody.
  void kill();

 private:
  pid_t process_ = -1;
  std::string url_;
};

/// Asks until the condition holds. False: it did not within kPatience.
template <class Condition>
[[nodiscard]] bool eventually(Condition condition) {
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() >= deadline) return false;
  }
  return true;
}

}  // namespace gimnet::test
