#pragma once

#include <cstdint>
#include <string>

#include "gimnet/gimi.hpp"

namespace gimnet::tool {

/// Tells breaks of the connection to the user, once each; not the last one, after which there is
/// nothing to wait for. Thread safety: one thread.
class ConnectionWatch {
 public:
  /// How long a break goes unnoticed at most by whoever looks now and then.
  static constexpr Timeout kPeriod{500};

  /// `node` must outlive it.
  explicit ConnectionWatch(Node& node) : node_(node) {}
  void look();
  /// As look(), at most once in kPeriod: for a loop in which something comes all the time. `now_ns`
  /// as steady_now_ns().
  void look_now_and_then(std::int64_t now_ns);
  /// A message says over which connection it came: looks if that is a newer one than was known. Not
  /// at those that wait since before a break: a tool that lags behind may have thousands of them.
  void take(const Message& message) {
    if (message.reconnects() > reconnects_) look();
  }
  /// As look(), where nobody will try to connect any more; also of a node that was closed.
  void look_at_end();
  /// As look(). False: no connection will come any more.
  [[nodiscard]] bool goes_on();

 private:
  void look(const char* afterwards);

  Node& node_;
  bool connected_ = true;
  std::uint32_t reconnects_ = 0;
  std::int64_t next_look_ns_ = 0;
  std::string told_;  ///< why it broke last
};

}  // namespace gimnet::tool
