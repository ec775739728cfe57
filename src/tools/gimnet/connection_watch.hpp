#pragma once

#include <cstdint>
#include <string>

#include "gimnet/gimi.hpp"

namespace gimnet::tool {

/// Tells breaks of the connection to the user, once each. Thread safety: one thread.
class ConnectionWatch {
 public:
  /// `node` must outlive it.
  explicit ConnectionWatch(Node& node) : node_(node) {}
  void look();

 private:
  Node& node_;
  bool connected_ = true;
  std::uint32_t reconnects_ = 0;
  std::string told_;  ///< why it broke last
};

}  // namespace gimnet::tool
