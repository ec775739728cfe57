#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "hub/control/state/sessions.hpp"
#include "proto/control/control_message.hpp"

namespace gimnet::hub {

class NameCopies;
class Topics;

/// Names of nodes: each has one holder. A live holder keeps it against everybody; one within its
/// grace time keeps it against nobody but gets it back if nobody took it. Decides whether a name is
/// free: nodes and services of all hubs share one space of names. In the order of names, which no
/// choice of names can make slow, and which finds at once all that begin alike. Thread safety:
/// none. Lifetime: sessions and topics outlive it. Limits: one name a session.
class Directory {
 public:
  using Names = std::map<std::string, NodeIndex, std::less<>>;

  Directory(const Sessions& sessions, const Topics& topics)
      : sessions_(sessions), topics_(topics) {}

  /// The network of hubs has these names from now on: nobody gets one that another hub holds.
  /// Lifetime: they outlive this.
  void join_network(const NameCopies& names) { network_ = &names; }

  /// The index of the node that holds the name.
  [[nodiscard]] std::optional<NodeIndex> find(std::string_view name) const;

  /// The node that asks for a name.
  struct Claimant {
    const Session* session = nullptr;  ///< null: somebody new
    NodeId former{};                   ///< the id that it had at this hub or another one; 0: none
    bool had_name = false;             ///< as in JoinRequest
  };
  /// Why the claimant cannot have the name; nothing if it can, perhaps from a holder who is away
  /// and whom the caller then has to end.
  [[nodiscard]] std::optional<proto::Goodbye> refusal(std::string_view name,
                                                      const Claimant& claimant,
                                                      std::chrono::milliseconds now) const;
  /// Why nobody may advertise a service of that full name: a node has it as its name.
  [[nodiscard]] std::optional<proto::Refusal> service_refusal(std::string_view full_name) const;
  /// Does a service of this hub have that name, or a node, even one that is away?
  [[nodiscard]] bool in_use(std::string_view name) const {
    return names_.contains(name) || is_service(name);
  }

  /// REQUIRES: nobody holds the name.
  void put(std::string_view name, NodeIndex index);
  /// Nothing happens for a name that nobody holds, the empty one included.
  void remove(std::string_view name);
  [[nodiscard]] const Names& names() const { return names_; }
  [[nodiscard]] std::size_t size() const { return names_.size(); }

 private:
  [[nodiscard]] bool is_service(std::string_view name) const;
  /// Why it cannot be had from its holder at this hub.
  [[nodiscard]] std::optional<proto::Goodbye> holder_refusal(std::string_view name,
                                                             std::chrono::milliseconds now) const;
  /// The same for what other hubs have.
  [[nodiscard]] std::optional<proto::Goodbye> network_refusal(std::string_view name,
                                                              const Claimant& claimant,
                                                              std::chrono::milliseconds now) const;

  const Sessions& sessions_;
  const Topics& topics_;
  const NameCopies* network_ = nullptr;  ///< or none: a hub that has had no link yet
  Names names_;
};

}  // namespace gimnet::hub
