#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "client/nif/outgoing.hpp"

namespace gimnet::nif {

/// Where the own services went that have another group than a program may know of yet. A message
/// for a former group is for the service that had it when the message was sent: those that wait
/// meanwhile are told of each move, others find the last one. A group of 0 is that of a service
/// which the hub refuses, also for a message that waited then. Thread safety: guarded by its owner.
/// Limits: threads that send, own services.
class GroupMoves {
 public:
  struct Move {
    std::uint32_t former = 0;  ///< 0: none that is the service's alone
    std::uint32_t now = 0;
    bool reused = false;  ///< another own service has `former` by now
  };

  /// The services are declared again from now on: each may move once.
  void begin();
  void add(const Move& move);
  /// The own service that has the group ended.
  void forget(std::uint32_t group);

  /// A message that is just being sent.
  void redirect(Outgoing& message) const {
    if (!last_.empty()) redirect_known(message);
  }
  /// The hub refuses the service whose group that is or was.
  [[nodiscard]] bool refuses(std::uint32_t group) const;
  /// A message that waits: while this lives, add() redirects it.
  class Turn {
   public:
    Turn(GroupMoves& moves, Outgoing& message) : moves_(moves), message_(message) {
      moves_.waiting_.push_back({&message, false});
    }
    ~Turn();
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

   private:
    GroupMoves& moves_;
    const Outgoing& message_;
  };

 private:
  struct Waiting {
    Outgoing* message = nullptr;
    bool moved = false;  ///< since begin(): its group now may be the former one of another service
  };
  void redirect_known(Outgoing& message) const;

  std::vector<Waiting> waiting_;
  std::unordered_map<std::uint32_t, std::uint32_t>
      last_;  ///< former group and group of each service that moved
};

}  // namespace gimnet::nif
