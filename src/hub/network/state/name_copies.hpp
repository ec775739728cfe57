#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "hub/network/state/name_index.hpp"

namespace gimnet::hub {

/// A process that serves under a hub id.
struct HubRun {
  HubId hub;
  proto::HubInstance instance;
  friend auto operator<=>(const HubRun&, const HubRun&) = default;
};

/// A name as this hub knows it. Valid until: something changes.
struct KnownName {
  std::string_view name;
  HubId hub;
  std::string_view hub_name;
  const proto::route::NameClaim* claim = nullptr;
  proto::ns::NameStanding standing = proto::ns::NameStanding::held;
  std::chrono::milliseconds until{};  ///< unreachable: when it is free
};

/// The id by which listings have it: NodeId of a node, GroupId of a service.
template <class Id>
[[nodiscard]] Id id_of(const KnownName& known) {
  if constexpr (std::is_same_v<Id, NodeId>) {
    return known.claim->node;
  } else {
    return known.claim->service->group;
  }
}

/// A name of another hub came, changed or went.
struct NameChange {
  std::string name;
  HubId hub;
  std::optional<proto::route::NameClaim> before;
  std::optional<proto::route::NameClaim> after;
};

/// The place up to which the other side of a link has the names of one hub.
struct NamesPosition {
  proto::HubInstance instance;
  std::uint64_t version = 0;    ///< complete up to it, once all that was sent has come
  std::uint64_t forgotten = 0;  ///< as it was when the copy was last sent from its beginning
};

/// The names of all hubs: this hub's own, which it numbers by versions, and a copy of those of each
/// hub that can be reached. A copy is complete up to a version: it has each name that changed last
/// up to there as it is now. So what changed in a range of versions extends every copy that is
/// complete up to the begin of the range, from whichever link it comes. Thread safety: none. Time
/// is an argument. Limits: Options::bytes_max for the names of all other hubs, half of it for those
/// of one; of deleted names as many as of living ones of that hub, and kMarksLeast more. Own names
/// are bounded by those who put them.
class NameCopies {
 public:
  struct Options {
    HubRun self;
    std::chrono::milliseconds grace = std::chrono::seconds(30);
    std::size_t bytes_max = std::size_t{64} << 20;  ///< 1 MiB at least
  };
  static constexpr std::size_t kMarksLeast = 1'024;
  /// Changes of a hub that was away come within that time.
  static constexpr std::chrono::milliseconds kCatchUp = std::chrono::seconds(1);

  explicit NameCopies(const Options& options);

  // This hub's own names

  /// A node of this hub has the name, or provides the service of that full name. A claim of another
  /// node than before has a higher rank than those that are away, and a lower one than those that
  /// cannot be reached: whoever stands there keeps the name. `claim`: version and rank are not
  /// looked at.
  void put_own(std::string_view name, const proto::route::NameClaim& claim);
  /// Nothing happens for a name that is none of this hub.
  void remove_own(std::string_view name);
  /// Null: this hub has not that name.
  [[nodiscard]] const proto::route::NameClaim* own_claim(std::string_view name) const {
    const auto known = index_.find(name, options_.self.hub);
    return known ? &(*known)->second : nullptr;
  }
  /// Takes another hub id. All own names are to be put again.
  void renumber(HubId hub);
  /// Own names that a hub that can be reached has a better claim to, since the last call. The
  /// caller lets go of them, which it says by remove_own().
  [[nodiscard]] std::vector<KnownName> take_lost();

  // Copies

  /// These hubs can be reached now, besides this one. REQUIRES: ascending, each hub id once.
  /// Answers those whose copy has begun, or may go on.
  std::vector<HubId> set_reachable(std::span<const HubRun> hubs, std::chrono::milliseconds now);
  /// That hub has let go of the name, and says so in its own time: until then its node is away.
  void note_let_go(std::string_view name, HubId hub);
  /// Names the hub for people.
  void set_hub_name(HubId hub, std::string_view name);
  /// "": it is not known.
  [[nodiscard]] std::string_view hub_name(HubId hub) const {
    const auto found = copies_.find(hub);
    return found == copies_.end() ? std::string_view{} : found->second.hub_name;
  }
  /// Drops copies of hubs that could not be reached for the grace time, and names of the process
  /// before. True: something was dropped.
  bool forget(std::chrono::milliseconds now);
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_due() const;

  enum class Taken : std::uint8_t {
    changed,
    known,  ///< nothing new, or of a process of which there is no copy, or not what follows
    full,   ///< there is no room
  };
  Taken take(const proto::route::Names& names);
  /// The next message for a receiver that is at that place, which it moves. Nothing: it has all.
  [[nodiscard]] std::optional<proto::route::Names> next(HubId hub, NamesPosition& at) const;
  /// Of each other hub that can be reached.
  [[nodiscard]] std::vector<proto::route::NamesKnown::Entry> known() const;
  [[nodiscard]] std::optional<proto::route::NamesKnown::Entry> known(HubId hub) const;
  /// Hubs whose names did not fit when they came, once there is room again.
  [[nodiscard]] std::vector<HubId> take_starved();
  /// Not all names of that hub fit, and there is still no room. Nothing: all names are here.
  [[nodiscard]] std::optional<HubId> starved() const {
    const auto is_starved = [](const auto& each) { return each.second.starved; };
    const auto found = std::ranges::find_if(copies_, is_starved);
    return found == copies_.end() ? std::nullopt : std::optional{found->first};
  }
  /// The other hub of which this one has most bytes of names. REQUIRES: there is another hub.
  [[nodiscard]] HubId largest() const;
  /// Of the names of all other hubs.
  [[nodiscard]] std::size_t bytes_of_others() const {
    return bytes() - counts_of(options_.self.hub).bytes;
  }

  // Look-ups, among all hubs

  /// The best claim to a name: of hubs that can be reached before others.
  [[nodiscard]] std::optional<KnownName> find(std::string_view name) const;
  [[nodiscard]] std::optional<KnownName> find_node(NodeId node) const {
    return known_name(index_.nodes(), index_.nodes().find(node));
  }
  [[nodiscard]] std::optional<KnownName> find_group(GroupId group) const {
    return known_name(index_.groups(), index_.groups().find(group));
  }
  /// The first one with a higher id, for listings.
  [[nodiscard]] std::optional<KnownName> node_after(NodeId node) const {
    return known_name(index_.nodes(), index_.nodes().upper_bound(node));
  }
  [[nodiscard]] std::optional<KnownName> group_after(GroupId group) const {
    return known_name(index_.groups(), index_.groups().upper_bound(group));
  }
  /// Of other hubs, in the order in which they happened. Nothing is told of a copy that is dropped
  /// as a whole: `dropped_copies` counts these.
  [[nodiscard]] std::vector<NameChange> take_changes() { return std::exchange(changes_, {}); }
  [[nodiscard]] std::uint64_t dropped_copies() const { return dropped_copies_; }

  [[nodiscard]] const HubRun& self() const { return options_.self; }
  /// Names of that hub.
  [[nodiscard]] NameIndex::Counts counts_of(HubId hub) const { return index_.counts_of(hub); }
  [[nodiscard]] std::size_t bytes() const { return index_.bytes(); }
  [[nodiscard]] std::size_t size() const { return index_.nodes().size() + index_.groups().size(); }
  /// Times that names of a hub were not taken since there was no room.
  [[nodiscard]] std::uint64_t refused() const { return refused_; }

 private:
  using Place = NameIndex::Place;
  /// Version 0 is that of a name of the process before.
  struct Copy {
    proto::HubInstance instance;
    std::string hub_name;
    std::uint64_t version = 0;    ///< complete up to it
    std::uint64_t forgotten = 0;  ///< marks up to it may be missing
    std::map<std::uint64_t, Place> by_version;
    std::set<std::uint64_t> marks;  ///< versions of deleted names
    std::optional<std::chrono::milliseconds> unreachable_until;
    std::optional<std::chrono::milliseconds> former_until;
    /// Its hub was away. Until then names up to version `stale` take nothing from this hub: they
    /// may have changed meanwhile.
    std::optional<std::chrono::milliseconds> stale_until;
    std::uint64_t stale = 0;
    bool starved = false;
  };

  [[nodiscard]] Copy& own() { return copies_.at(options_.self.hub); }
  /// Only if it is of that process.
  [[nodiscard]] Copy* find_copy(const HubRun& run);
  [[nodiscard]] KnownName known_name(const NameIndex::Claims::value_type& entry) const;
  template <class Index>
  [[nodiscard]] std::optional<KnownName> known_name(const Index& index,
                                                    typename Index::const_iterator at) const {
    return at == index.end() ? std::nullopt : std::optional{known_name(*at->second)};
  }
  void begin_anew(HubId hub, Copy& copy, proto::HubInstance instance,
                  std::chrono::milliseconds now);
  void drop(HubId hub);
  void drop_former(HubId hub, Copy& copy);
  void put(HubId hub, Copy& copy, std::string_view name, const proto::route::NameClaim& claim);
  static void forget_version(Copy& copy, const proto::route::NameClaim& claim) {
    copy.by_version.erase(claim.version);
    copy.marks.erase(claim.version);
  }
  void erase(Copy& copy, Place place) {
    forget_version(copy, place->second);
    index_.erase(place);
  }
  /// Also tells of it.
  void remove(Copy& copy, Place place);
  void forget_marks(Copy& copy);
  /// Makes room at the id that the claim has. False: a newer name has it.
  [[nodiscard]] bool evict(Copy& copy, std::string_view name, const proto::route::NameClaim& claim);
  /// Has that other hub room for so many bytes more?
  [[nodiscard]] bool has_room(HubId hub, std::size_t bytes) const;
  [[nodiscard]] std::uint32_t rank_for(std::string_view name, NodeId node) const;
  [[nodiscard]] bool is_lost_to(const KnownName& other) const;
  /// The best claim that this hub has to give the name up for. Others may be better, and not count
  /// yet.
  [[nodiscard]] std::optional<KnownName> winner_over_own(std::string_view name) const;
  template <class Counts>
  [[nodiscard]] std::optional<KnownName> best_of(std::string_view name,
                                                 const Counts& counts) const {
    std::optional<KnownName> best;
    for (const auto& entry : index_.claims_to(name)) {
      if (entry.second.state == proto::route::NameState::deleted) continue;
      const KnownName known = known_name(entry);
      if (!counts(known)) continue;
      const auto reachable = [](const KnownName& one) {
        return one.standing != proto::ns::NameStanding::unreachable;
      };
      if (!best || reachable(known) > reachable(*best) ||
          (reachable(known) == reachable(*best) && wins(*known.claim, *best->claim)))
        best = known;
    }
    return best;
  }
  void compare_with_own(std::string_view name);
  void note_change(Place place, std::optional<proto::route::NameClaim> before);

  Options options_;
  NameIndex index_;
  std::map<HubId, Copy> copies_;  ///< this hub's own among them
  std::set<std::string, std::less<>> lost_;
  std::vector<NameChange> changes_;
  std::uint64_t refused_ = 0;
  std::uint64_t dropped_copies_ = 0;
};

}  // namespace gimnet::hub
