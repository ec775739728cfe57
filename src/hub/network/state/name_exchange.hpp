#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "hub/network/state/name_copies.hpp"
#include "hub/network/state/network_state.hpp"

namespace gimnet::hub {

/// Gives every hub a copy of the names of all hubs. A hub tells its neighbours up to which version
/// its copies are complete (NAMES_KNOWN): when a connection begins, and of a hub that can be
/// reached from then on. From there on a neighbour sends what changes (NAMES), each change once,
/// unless the other side has sent it itself. At most kNamesWindow messages are under way to a
/// neighbour. Pure state: what comes over links, and the time, are arguments, and what is to be
/// sent is taken out. After each call, or several at one time, advance() does what is due, and
/// take_sendings() gives what is to be sent, in order and behind the records of routes. Thread
/// safety: none. Errors: bytes that are no message are counted and otherwise ignored; calls for an
/// unknown link are ignored. Limits: those of NameCopies.
class NameExchange {
 public:
  /// After a link came up names may be missing for so long.
  static constexpr std::chrono::milliseconds kLearning = std::chrono::seconds(2);

  explicit NameExchange(const NameCopies::Options& options) : copies_(options) {}

  /// A connection of a link begins: the first one, or the next one after a break.
  void begin_connection(LinkNumber number, std::chrono::milliseconds now);
  /// NAMES_KNOWN, NAMES or NAMES_TAKEN came: the payload of a ROUTE frame.
  void take(LinkNumber number, std::span<const std::byte> bytes, std::chrono::milliseconds now);
  void end_link(LinkNumber number);
  /// The map was computed anew.
  void set_reachable(const NetworkMap& map, const RecordStore& store,
                     std::chrono::milliseconds now);
  void set_reachable(std::span<const HubRun> hubs, std::chrono::milliseconds now);
  void put_own(std::string_view name, const proto::route::NameClaim& claim);
  void remove_own(std::string_view name);
  void note_let_go(std::string_view name, HubId hub) { copies_.note_let_go(name, hub); }
  /// Takes another hub id: all own names are to be put again. REQUIRES: no link.
  void renumber(HubId hub);
  /// A hub that dials has started: names may be missing.
  void begin_learning(std::chrono::milliseconds now);

  void advance(std::chrono::milliseconds now);
  /// When advance() has something to do. Nothing: not before something comes.
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_due() const;
  [[nodiscard]] std::vector<Sending> take_sendings() { return std::exchange(sendings_, {}); }
  /// Own names that were lost to a better claim, and changes of names of others: see NameCopies.
  [[nodiscard]] std::vector<KnownName> take_lost() { return copies_.take_lost(); }
  [[nodiscard]] std::vector<NameChange> take_changes() { return copies_.take_changes(); }

  [[nodiscard]] const NameCopies& copies() const { return copies_; }
  [[nodiscard]] bool is_learning(std::chrono::milliseconds now) const {
    return now < learning_until_;
  }
  /// Messages that were not what they should be.
  [[nodiscard]] std::uint64_t malformed() const { return malformed_; }

 private:
  struct Link {
    std::map<HubId, NamesPosition> wants;  ///< of the other side, by hub
    std::set<HubId> behind;                ///< of these something may have to be sent
    HubId last_sent;
    std::size_t under_way = 0;
  };
  [[nodiscard]] Link* find(LinkNumber number);
  void take(LinkNumber number, Link& link, const proto::route::NamesKnown& known);
  void take(LinkNumber number, Link& link, const proto::route::Names& names);
  void note_change(HubId hub);
  void send_due(LinkNumber number, Link& link);
  void tell_known(std::span<const proto::route::NamesKnown::Entry> entries, LinkNumber number);
  void tell_known_to_all(std::span<const HubId> hubs);
  template <class Message>
  void send(LinkNumber number, const Message& message);

  NameCopies copies_;
  std::map<LinkNumber, Link> links_;
  std::vector<Sending> sendings_;
  bool work_ = false;  ///< something may have to be sent
  std::chrono::milliseconds learning_until_ = std::chrono::milliseconds::min();
  std::uint64_t malformed_ = 0;
};

}  // namespace gimnet::hub
