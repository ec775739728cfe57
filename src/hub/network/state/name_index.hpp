#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <ranges>
#include <string>
#include <string_view>
#include <vector>

#include "proto/control/route_names.hpp"

namespace gimnet::hub {

/// Of two claims to one name the one that wins, at every hub: that of a node before that of a
/// service, one that is held before one that is away, then the higher rank, then the lower node id.
/// REQUIRES: neither is deleted.
[[nodiscard]] bool wins(const proto::route::NameClaim& claim, const proto::route::NameClaim& over);

/// The claims of all hubs to names, one for each name and hub, deleted ones included. Those that
/// live are found by node id and by group id, too: each id has one name. Thread safety: none.
class NameIndex {
 public:
  /// Bytes that one claim counts besides its text: the entries of three trees.
  static constexpr std::size_t kClaimBytes = 288;

  struct Key {
    std::string name;
    HubId hub;
  };
  struct KeyView {
    std::string_view name;
    HubId hub;
  };
  struct Less {
    using is_transparent = void;
    template <class A, class B>
    bool operator()(const A& a, const B& b) const {
      const auto order = std::string_view(a.name) <=> std::string_view(b.name);
      return order != 0 ? order < 0 : a.hub < b.hub;
    }
  };
  using Claims = std::map<Key, proto::route::NameClaim, Less>;
  using Place = Claims::iterator;

  /// Bytes that a claim to that name counts.
  [[nodiscard]] static std::size_t count_of(std::string_view name) {
    return kClaimBytes + name.size();
  }

  [[nodiscard]] std::optional<Place> find(std::string_view name, HubId hub) const;
  /// The claims to a name, by ascending hub id.
  [[nodiscard]] auto claims_to(std::string_view name) const {
    return std::ranges::subrange(claims_.lower_bound(KeyView{name, HubId{}}),
                                 claims_.upper_bound(KeyView{name, kEveryHub}));
  }
  /// The living claim that has this one's node id, or its group id.
  [[nodiscard]] std::optional<Place> holder(const proto::route::NameClaim& claim) const;
  struct Counts {
    std::uint32_t nodes = 0;     ///< that have a name
    std::uint32_t services = 0;  ///< living ones, as the nodes
    std::size_t bytes = 0;       ///< of all its claims, as count_of() counts
  };
  [[nodiscard]] Counts counts_of(HubId hub) const {
    const auto found = counts_.find(hub);
    return found == counts_.end() ? Counts{} : found->second;
  }
  /// All living claims of a hub.
  [[nodiscard]] std::vector<Place> live_of(HubId hub) const;

  /// Adds it, or puts it in place of the one that the name has at that hub. REQUIRES: nobody else
  /// has its id.
  Place put(std::string_view name, HubId hub, const proto::route::NameClaim& claim);
  void erase(Place place);

  [[nodiscard]] const std::map<NodeId, Place>& nodes() const { return nodes_; }
  [[nodiscard]] const std::map<GroupId, Place>& groups() const { return groups_; }
  /// Of all names, as count_of() counts.
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  void forget_id(const Claims::value_type& entry);

  mutable Claims claims_;  // find() gives places that may be changed
  std::map<NodeId, Place> nodes_;
  std::map<GroupId, Place> groups_;
  std::map<HubId, Counts> counts_;
  std::size_t bytes_ = 0;
};

}  // namespace gimnet::hub
