#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <list>
#include <optional>
#include <span>

#include "hub/control/acceptor.hpp"
#include "hub/control/hub_facts.hpp"
#include "hub/control/links.hpp"
#include "hub/control/network_names.hpp"
#include "hub/control/state/membership.hpp"
#include "hub/limits.hpp"
#include "hub/observe/request_counters.hpp"
#include "proto/control/control_message.hpp"
#include "proto/control/link.hpp"

namespace gimnet::hub {

/// The request of a stranger that says HELLO as a node. `wall`: since 1970. Valid until: `hello`
/// changes.
[[nodiscard]] JoinRequest join_request_of(const Stranger& stranger, const proto::Hello& hello,
                                          std::chrono::milliseconds wall, bool had_name);

/// An answer to a request of this hub itself.
struct HubAnswer {
  HubId from;
  std::uint16_t request = 0;
  proto::Status status{};
};

/// Nodes that come from another hub: the hub that gave them their token is asked to let go of them,
/// and they are admitted when it has answered, cannot be reached, or is silent for kAnswerTime.
/// Thread safety: the conductor's thread only. Ownership: of the transports of those who wait.
/// Limits: limits.handshakes of them; one more is admitted as a node like any other.
class MovingNodes {
 public:
  static constexpr std::chrono::milliseconds kAnswerTime = std::chrono::seconds(1);

  struct Parts {
    const HubFacts& facts;
    const Limits& limits;
    Links& links;
    NetworkNames& names;
    RefusalCounters* refusals = nullptr;  ///< or none
  };
  explicit MovingNodes(const Parts& parts) : parts_(parts) {}

  /// Takes the stranger's transport if HELLO shows the token of a hub that can be asked.
  [[nodiscard]] bool take(Stranger& stranger, const proto::Hello& hello,
                          std::chrono::milliseconds now);
  /// Takes the stranger's transport and returns nothing, or leaves it and says why not. `had_name`:
  /// see JoinRequest.
  using Admit =
      std::function<std::optional<proto::Goodbye>(Stranger&, const proto::Hello&, bool had_name)>;
  /// Admits those who wait no longer. To be called when time passes, routes change or answers come.
  void settle(std::span<const HubAnswer> answers, std::chrono::milliseconds now,
              const Admit& admit);
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_due() const;

 private:
  struct Waiting {
    Stranger stranger;
    proto::Hello hello;
    std::uint16_t request = 0;
    std::chrono::milliseconds until{};
    bool had_name = false;
    bool answered = false;
    bool let_go = false;
  };
  void take_answer(const HubAnswer& answer);
  void turn_away(const Stranger& stranger, const proto::Goodbye& goodbye);

  const Parts parts_;
  std::list<Waiting> waiting_;  ///< in the order of their times. Limit: handshakes
  std::uint16_t last_request_ = 0;
};

}  // namespace gimnet::hub
