#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "hub/control/acceptor.hpp"
#include "hub/control/hub_facts.hpp"
#include "hub/control/hub_link.hpp"
#include "hub/control/link_roster.hpp"
#include "hub/limits.hpp"
#include "hub/network/state/network_state.hpp"
#include "hub/shard/commands.hpp"
#include "proto/control/link.hpp"

namespace gimnet::hub {

/// The words of a hub in HELLO and WELCOME of a link, and its judgement of the other end's. Thread
/// safety: the conductor's thread only. Lifetime: its parts outlive it.
class LinkHandshake {
 public:
  struct Parts {
    const HubFacts& facts;
    const Limits& limits;
    const LinksOptions& options;
    const NetworkState& network;
    const LinkRoster::All& links;
  };
  explicit LinkHandshake(const Parts& parts) : parts_(parts) {}

  /// The connection of a stranger who may link; `said`: what WELCOME answers.
  [[nodiscard]] AttachCommand accept(Stranger& stranger, const proto::Hello& hello,
                                     const proto::HubIntroduction& said,
                                     std::int64_t wall_ns) const;
  [[nodiscard]] proto::HubIntroduction introduce(const LinkTerms& terms) const;
  [[nodiscard]] proto::Welcome welcome(const proto::HubIntroduction& said, const LinkTerms& terms,
                                       std::int64_t wall_ns) const;
  /// `counts`: the number under which this end counts it. REQUIRES: link.is_dialled().
  [[nodiscard]] proto::Hello hello_for(const HubLink& link, std::uint64_t counts) const;
  /// Why that stranger may not link, whoever its hub is; nothing: it may.
  [[nodiscard]] std::optional<proto::Goodbye> refusal(const Stranger& stranger,
                                                      const proto::Hello& hello) const;
  /// The refusal of that hub at the other end of a link, which both ends look for; nothing: it may
  /// be there. `answer`: that of NetworkState. REQUIRES: it is none that an old link is to be asked
  /// about.
  [[nodiscard]] std::optional<proto::Goodbye> refusal_of(const proto::HubIntroduction& said,
                                                         const LinkAdmissionAnswer& answer) const;
  /// The hub that keeps this hub's id, and the link `over` which that was heard (null: it is gone).
  /// REQUIRES: Verdict::id_taken.
  [[nodiscard]] std::string taken_sentence(const HubLink* over) const;

 private:
  /// The hub that has an id: its name, and the link over which it is reached, as far as known.
  [[nodiscard]] std::string describe(const proto::HubKey& holder) const;

  const Parts parts_;
};

}  // namespace gimnet::hub
