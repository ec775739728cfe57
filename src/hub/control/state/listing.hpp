#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "hub/control/state/membership.hpp"
#include "proto/control/pattern.hpp"

// Which nodes and services fit a pattern, in ascending order of their ids and in bounded pieces of
// work: what LIST and SERVICES page through. What joins or leaves between two pages neither hides
// nor repeats anything else. Thread safety: pure functions.

namespace gimnet::hub {

/// A piece of a listing, of nodes (NodeIndex) or services (GroupIndex).
template <class Index>
struct Listed {
  std::vector<Index> indices;  ///< ascending
  bool more = false;
  Index next;                 ///< if there is more: continue after this index
  std::size_t looked_at = 0;  ///< nodes or services
};

template <class Index>
struct ListingRequest {
  const proto::Pattern* pattern = nullptr;  ///< nullptr: all, those without a name too
  Index after;                              ///< continue after this index
  bool connected_only = false;              ///< of nodes: none within their grace time
  std::size_t most = 0;                     ///< indices in this piece
  std::size_t work = 0;                     ///< nodes or services that may be looked at
};

[[nodiscard]] Listed<NodeIndex> list_nodes(const Membership& membership,
                                           const ListingRequest<NodeIndex>& request);
[[nodiscard]] Listed<GroupIndex> list_services(const Topics& topics,
                                               const ListingRequest<GroupIndex>& request);

/// The same where all whose names begin with the pattern's parts before its first `*` are few:
/// these alone are looked at, in one piece of work, whatever else begins with the same letters.
/// Nothing: there is no pattern, it begins with a
/// `*`, or they are more than `work`.
[[nodiscard]] std::optional<Listed<NodeIndex>> list_few_nodes(
    const Membership& membership, const ListingRequest<NodeIndex>& request);
[[nodiscard]] std::optional<Listed<GroupIndex>> list_few_services(
    const Topics& topics, const ListingRequest<GroupIndex>& request);

}  // namespace gimnet::hub
