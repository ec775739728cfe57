#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "base/check.hpp"
#include "base/ids.hpp"
#include "hub/data/tables/node_table.hpp"

namespace gimnet::hub {

/// The next hop of frames for another hub: the link that carries there, and the hub behind it.
struct NextHop {
  NodePlace link;  ///< as a node's place: the link is a session on a shard, too
  HubId neighbour;
  bool one_way = false;  ///< the link may not bring what nodes of that hub send

  [[nodiscard]] bool exists() const { return link.exists(); }
  friend bool operator==(const NextHop&, const NextHop&) = default;
};

/// Hub id to next hop. Thread safety: one writer (the conductor), any number of readers; reads are
/// wait-free. A reader may see the link of one publish() and the neighbour of another: that costs
/// the check against sending a frame back, once.
class RouteTable {
 public:
  static constexpr std::size_t kHubIds = 4096;

  /// A place with generation 0: there is no route. REQUIRES: hub < 4096.
  void publish(HubId hub, const NextHop& next) {
    GIMNET_CHECK(hub.value() < kHubIds);
    const auto word =
        static_cast<std::uint16_t>(next.neighbour.value() | (next.one_way ? kOneWay : 0u));
    // relaxed: the store below hands it over
    neighbours_[hub.value()].store(word, std::memory_order_relaxed);
    // release pairs with the acquire in find(): who sees the link sees its neighbour.
    links_[hub.value()].store(pack(next.link), std::memory_order_release);
  }
  /// The shards (a bit set) with a link that is a next hop.
  void publish_shards(std::uint64_t shards) { shards_.store(shards, std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t shards() const {
    // relaxed: a shard that is missed had no link a moment ago
    return shards_.load(std::memory_order_relaxed);
  }
  [[nodiscard]] NextHop find(HubId hub) const {
    // acquire pairs with the release in publish()
    const NodePlace link = unpack(links_[hub.value()].load(std::memory_order_acquire));
    const std::uint16_t word = neighbours_[hub.value()].load(std::memory_order_relaxed);
    return {link, HubId{static_cast<std::uint16_t>(word & (kOneWay - 1))}, word >= kOneWay};
  }

 private:
  static constexpr std::uint16_t kOneWay = 0x8000;  ///< beside a hub id
  std::array<std::atomic<std::uint64_t>, kHubIds> links_{};
  std::array<std::atomic<std::uint16_t>, kHubIds> neighbours_{};
  std::atomic<std::uint64_t> shards_{0};
};

}  // namespace gimnet::hub
