#pragma once

#include <cstdint>

#include "client/nif/outgoing.hpp"
#include "client/nif/send_queue.hpp"

namespace gimnet::nif {

/// The new groups of own services. After a break or a change of its name a service may have another
/// group, and a program may still send to the former one.
/// Thread safety: guarded by its owner. Limits: own services, and former groups that a program was
/// told of.
class GroupMoves {
 public:
  /// The services are declared again. GROUP messages wait until end().
  void begin() { settled_ = false; }
  /// The services have these groups now, by their former ones; 0: the hub refuses the service. May
  /// throw std::bad_alloc.
  void add(const SendQueue::GroupMap& moves);
  void end() { settled_ = true; }
  /// GROUP messages may go.
  [[nodiscard]] bool settled() const { return settled_; }

  /// An own service has that group from now on, or had it until now.
  void forget(std::uint32_t group);
  /// A message to a former group goes to the one that its service has now.
  void redirect(Outgoing& message) const {
    if (!moves_.empty() && message.is_group()) redirect_group(message);
  }
  /// The hub refuses the service whose group that is or was.
  [[nodiscard]] bool refuses(std::uint32_t group) const;

 private:
  void redirect_group(Outgoing& message) const;

  bool settled_ = true;
  SendQueue::GroupMap moves_;  ///< by former groups; 0: refused
};

}  // namespace gimnet::nif
