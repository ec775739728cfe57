#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/ids.hpp"
#include "hub/network/state/own_record.hpp"
#include "hub/network/state/record_store.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {

/// A link among those of this hub, as the owner of the network's state numbers them. 0: none.
using LinkNumber = StrongId<struct LinkNumberTag, std::uint32_t>;

/// A neighbour of this hub, and the link to it that carries.
struct CarryingLink {
  proto::route::Neighbour neighbour;
  LinkNumber link;
};

/// The way to one hub id.
struct Way {
  proto::HubKey hub;
  LinkNumber link;         ///< that a frame for the hub takes; 0: there is none, it is too far
  std::uint32_t cost = 0;  ///< of the whole way
  std::uint16_t hops = 0;  ///< links of the whole way
};

/// The network as the records draw it, and the shortest ways through it. An edge counts if both
/// ends report it, each naming the other by hub id and unique id; the higher of the two costs
/// counts. Of ways of equal cost the one with fewer hops is taken, then the one over the lowest
/// hub id. Thread safety: immutable once computed. Cost: that of sorting all edges.
class NetworkMap {
 public:
  static constexpr std::size_t kHubIds = 4096;

  /// Nobody but this hub.
  explicit NetworkMap(const HubIdentity& self) : reachable_{self.key} {}
  /// REQUIRES: `neighbours` ascending, each hub once.
  NetworkMap(const HubIdentity& self, const RecordStore& store,
             std::span<const CarryingLink> neighbours);

  /// All hubs that a way of edges leads to, however long, this hub among them; ascending.
  [[nodiscard]] const std::vector<proto::HubKey>& reachable() const { return reachable_; }
  /// One for each hub id that can be reached but this hub's; ascending. Of two hubs with one id it
  /// leads to the one that is preferred.
  [[nodiscard]] const std::vector<Way>& ways() const { return ways_; }
  /// By hub id: the link that a frame for that hub takes; 0: none.
  [[nodiscard]] const std::array<LinkNumber, kHubIds>& next_hops() const { return next_hops_; }
  /// The way to another hub that keeps this hub's id. Nothing: none can be reached.
  [[nodiscard]] const std::optional<Way>& own_id_holder() const { return own_id_holder_; }

 private:
  void keep_preferred(const HubIdentity& self, const RecordStore& store,
                      const std::vector<Way>& ways);

  std::vector<proto::HubKey> reachable_;
  std::vector<Way> ways_;
  std::array<LinkNumber, kHubIds> next_hops_{};
  std::optional<Way> own_id_holder_;
};

/// The identity that a record tells. Nothing: its part 0 is not known.
[[nodiscard]] std::optional<HubIdentity> identity_of(const StoredRecord& record);

}  // namespace gimnet::hub
