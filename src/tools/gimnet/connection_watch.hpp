#pragma once

#include <cstdint>
#include <string>

#include "gimnet/gimi.hpp"

namespace gimnet::tool {

/// Tells breaks of the connection to the user, once each; not the last one, after which there is nothing to wait for.
/// Thread safety: one thread.
class ConnectionWatch {
 public:
  /// `node` must outlive it.
  explicit ConnectionWatch(Node& node) : node_(node) {}
  void look();
  /// As look(). False: no connection will come any more.
  [[nodiscard]] bool goes_on();

 private:
  Node& node_;
  bool connected_ = true;
  std::uint32_t reconnects_ = 0;
  std::string told_;  ///< why it broke last
};

}  // namespace gimnet::tool
