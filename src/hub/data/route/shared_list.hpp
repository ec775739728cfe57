#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "base/endian.hpp"
#include "base/ids.hpp"
#include "hub/data/route/node_table.hpp"
#include "proto/frame/frame_header.hpp"
#include "proto/frame/report.hpp"

namespace gimnet::hub {

/// The ids of a LIST frame while it is shared with other shards. It says which nodes each of them
/// is to see to, since the tables may change until they look: two of them would count a node then,
/// or none. The shard that takes the frame in is the only one that has it, and so writes that into
/// it, but so that it can still be told (by a REPORT) what the sender wrote: as that is ascending,
/// the ids of this hub's nodes are neighbours. Which they are stands beside n in dst; an id among
/// them that is another shard's has, in the place of this hub's number, one that tells the shard.
/// Thread safety: a value type and pure functions.
struct SharedList {
  std::uint32_t size = 0;   ///< n, 1..1024
  std::uint32_t first = 0;  ///< of this hub's nodes
  std::uint32_t count = 0;  ///< of this hub's nodes

  /// The header, and as much of what follows it as a REPORT shows.
  using FrameStart = std::array<std::byte, proto::kHeaderSize + proto::kReportFollowingMax>;

  /// REQUIRES: `size` ids as the sender wrote them, 1..1024, ascending.
  [[nodiscard]] static SharedList find(const std::byte* ids, std::uint32_t size, HubId hub) {
    if (hub_of(id_at(ids, 0)) == hub && hub_of(id_at(ids, size - 1)) == hub) return {size, 0, size};
    std::uint32_t first = 0;
    while (first < size && hub_of(id_at(ids, first)) < hub) ++first;
    std::uint32_t end = first;
    while (end < size && hub_of(id_at(ids, end)) == hub) ++end;
    return {size, first, end - first};
  }
  /// What pack() made.
  [[nodiscard]] static SharedList unpack(std::uint32_t dst) {
    return {(dst & kMask) + 1, (dst >> kBits) & kMask, ((dst >> (2 * kBits)) & kMask) + 1};
  }
  /// For dst. REQUIRES: count > 0.
  [[nodiscard]] std::uint32_t pack() const {
    return (size - 1) | first << kBits | (count - 1) << (2 * kBits);
  }

  [[nodiscard]] std::uint32_t end() const { return first + count; }
  [[nodiscard]] std::uint32_t bytes() const { return size * kIdSize; }
  [[nodiscard]] static NodeId id_at(const std::byte* ids, std::uint32_t index) {
    return NodeId{load_le<std::uint32_t>(ids + std::size_t{kIdSize} * index)};
  }
  /// The node's id where it is that shard's: changed in the hub's number, modulo 2^12.
  [[nodiscard]] static NodeId marked(NodeId node, ShardIndex shard) {
    return NodeId{node.value() + ((std::uint32_t{shard.value()} + 1) << kIndexBits)};
  }
  static void mark(std::byte* ids, std::uint32_t index, NodeId node, ShardIndex shard) {
    store_le(ids + std::size_t{kIdSize} * index, marked(node, shard).value());
  }

  /// How many of the nodes are that shard's.
  [[nodiscard]] std::uint32_t count_of(ShardIndex shard, const std::byte* ids, HubId hub) const {
    const HubId mark = hub_of(marked(make_id<NodeId>(hub, 0), shard));
    std::uint32_t found = 0;
    for (std::uint32_t i = first; i < end(); ++i) found += hub_of(id_at(ids, i)) == mark ? 1 : 0;
    return found;
  }

  /// The beginning of the frame as its sender wrote it, whatever was marked in it by now.
  [[nodiscard]] FrameStart as_sent(const std::byte* frame, HubId hub) const {
    FrameStart start{};
    proto::FrameHeader header = proto::load_header(frame);
    header.dst = size;
    proto::store_header(start.data(), header);
    std::byte* const ids = start.data() + proto::kHeaderSize;
    std::memcpy(ids, frame + proto::kHeaderSize,
                std::min<std::size_t>(header.length, proto::kReportFollowingMax));
    for (std::uint32_t i = first;
         i < std::min<std::uint32_t>(end(), proto::kReportFollowingMax / kIdSize); ++i) {
      store_le(ids + std::size_t{kIdSize} * i,
               make_id<NodeId>(hub, index_of(id_at(ids, i))).value());
    }
    return start;
  }

  friend bool operator==(const SharedList&, const SharedList&) = default;

 private:
  static constexpr std::uint32_t kIdSize = 4;
  static constexpr std::uint32_t kBits = 10;
  static constexpr std::uint32_t kMask = (1u << kBits) - 1;
  static_assert(proto::kListRecipientsMax == kMask + 1 && 3 * kBits <= 32);
  // No shard's mark is this hub's number.
  static_assert(kShardsMax < std::uint32_t{1} << (32 - kIndexBits));
};

}  // namespace gimnet::hub
