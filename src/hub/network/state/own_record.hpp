#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hub/network/state/record_store.hpp"

namespace gimnet::hub {

/// Bounds how often something is done: the first time at once, then with pauses that double while
/// changes go on. A quiet time of two pauses begins anew. Thread safety: none. Time is an argument.
class ChangePace {
 public:
  struct Pauses {
    std::chrono::milliseconds first;
    std::chrono::milliseconds most;
  };
  explicit ChangePace(Pauses pauses) : pauses_(pauses), pause_(pauses.first) {}

  /// It may be done at once.
  void hurry() { next_ = std::chrono::milliseconds::min() / 2; }

  /// From when on it may be done.
  [[nodiscard]] std::chrono::milliseconds next() const { return next_; }
  /// It is done. REQUIRES: now >= next().
  void note_done(std::chrono::milliseconds now) {
    const bool quiet = now >= next_ + pause_;
    pause_ = quiet ? pauses_.first : std::min(2 * pause_, pauses_.most);
    next_ = now + pause_;
  }

 private:
  const Pauses pauses_;
  std::chrono::milliseconds pause_;
  std::chrono::milliseconds next_ = std::chrono::milliseconds::min() / 2;
};

/// A hub as HELLO, WELCOME and its record name it.
struct HubIdentity {
  proto::HubKey key;
  proto::HubInstance instance;
  bool configured = false;  ///< its hub id was configured, and not drawn
};
/// Of two hubs that have one hub id, the one that keeps it: a configured id before a drawn one,
/// then the lower unique id. Every hub prefers the same.
[[nodiscard]] bool is_preferred(const HubIdentity& hub, const HubIdentity& to);

/// The words that a hub says of itself besides its neighbours.
struct HubWords {
  std::string name;
  std::string version;
  std::uint64_t features = 0;
  std::uint64_t features_required = 0;
};

/// The record that this hub sends: which neighbours it has, in parts. A neighbour stays in its
/// part, so that one change is one part. Thread safety: none. Time is an argument. Limits:
/// kPartsMax parts of kNeighboursMax neighbours; changes go out at once, then with pauses of 50 ms
/// that double to 1 s (a star of 4,000 robots that all start).
class OwnRecord {
 public:
  static constexpr ChangePace::Pauses kChangePauses{std::chrono::milliseconds(50),
                                                    std::chrono::seconds(1)};
  /// Between two times that the hub goes on behind its own record. The first time is at once. Up to
  /// 255 ms more by its instance: two copies that went on at the same moments would never hear an
  /// answer to what they said last.
  static constexpr std::chrono::milliseconds kGoOnPause = std::chrono::seconds(1);

  OwnRecord(HubIdentity identity, HubWords words);

  [[nodiscard]] const HubIdentity& identity() const { return identity_; }
  /// REQUIRES: ascending, each once; at most kPartsMax times kNeighboursMax.
  void set_neighbours(const std::vector<proto::route::Neighbour>& neighbours);
  /// The hub has another id. Its sequence goes on, so that it may take a former id again.
  void renumber(HubId hub);

  /// A part of this hub's record came from a link: of a former life, of a copy of its state folder,
  /// or invented. If it would be taken for newer than what the hub says or will say next, the hub
  /// goes on behind it.
  void hear(const proto::route::RecordPart& heard);
  /// Another process with this unique id runs: this hub went on behind a record that named it, and
  /// was named again. One record alone may be of a process that has ended. Nothing: none is known.
  [[nodiscard]] std::optional<proto::HubInstance> living_copy() const { return living_copy_; }
  void forget_copy();
  /// Another part goes by that sequence of this instance: all of this hub's are to pass it.
  void go_on_behind(std::uint64_t sequence) { pass_ = std::max(pass_.value_or(0), sequence); }
  /// The next change is said at once, however many were said lately.
  void hurry() { change_pace_.hurry(); }

  /// The parts that are to be sent now.
  [[nodiscard]] std::vector<PartRef> take_due(std::chrono::milliseconds now);
  /// When take_due() gives something. Nothing: not before something changes.
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_due() const;

 private:
  struct Part {
    std::vector<proto::route::Neighbour> neighbours;  ///< ascending
    bool changed = false;
    std::uint64_t sequence = 0;  ///< as it was sent last; 0: never
  };
  void add(const proto::route::Neighbour& neighbour);
  /// All parts that others may have. One that was only skipped by a forged number is none.
  void say_all_again();
  [[nodiscard]] proto::route::RecordPart said(std::uint16_t number) const;

  HubIdentity identity_;
  const HubWords words_;
  std::vector<Part> parts_{1};  ///< at least part 0; never fewer than were sent
  std::uint64_t sequence_ = 0;  ///< the last that was used
  bool changed_ = true;
  ChangePace change_pace_{kChangePauses};
  proto::HubInstance behind_;
  /// The highest sequence heard of another instance that has to be passed. Nothing: none.
  std::optional<std::uint64_t> pass_;
  ChangePace go_on_pace_;
  bool is_named_ = false;  ///< by a record that is to be passed
  /// The sequence of part 0 when this hub last went on behind a record that named it.
  std::optional<std::uint64_t> question_;
  std::optional<proto::HubInstance> living_copy_;
};

}  // namespace gimnet::hub
