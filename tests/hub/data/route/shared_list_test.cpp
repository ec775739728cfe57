#include "hub/data/route/shared_list.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace gimnet::hub {
namespace {

constexpr HubId kHub{7};

std::vector<std::byte> ids_of(const std::vector<NodeId>& nodes) {
  std::vector<std::byte> ids(4 * nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) store_le(ids.data() + 4 * i, nodes[i].value());
  return ids;
}

NodeId node(std::uint16_t hub, std::uint32_t index) { return make_id<NodeId>(HubId{hub}, index); }

SharedList find(const std::vector<NodeId>& nodes, HubId hub = kHub) {
  return SharedList::find(ids_of(nodes).data(), static_cast<std::uint32_t>(nodes.size()), hub);
}

TEST(SharedList, FindsTheNodesOfThisHub) {
  EXPECT_EQ(find({node(7, 1)}), (SharedList{1, 0, 1}));
  EXPECT_EQ(find({node(7, 0), node(7, kIndexMask)}), (SharedList{2, 0, 2}));
  EXPECT_EQ(find({node(0, 1), node(6, 9), node(7, 1), node(7, 2), node(8, 1)}),
            (SharedList{5, 2, 2}));
  EXPECT_EQ(find({node(6, 9), node(7, 3)}), (SharedList{2, 1, 1}));
  EXPECT_EQ(find({node(7, 3), node(4095, 1)}), (SharedList{2, 0, 1}));
  EXPECT_EQ(find({node(6, 1), node(8, 1)}).count, 0u);
  EXPECT_EQ(find({node(8, 1)}).count, 0u);
  EXPECT_EQ(find({node(1, 1), node(2, 1)}).count, 0u);
}

TEST(SharedList, FitsIntoDst) {
  for (const SharedList& list :
       {SharedList{1, 0, 1}, SharedList{1024, 0, 1024}, SharedList{1024, 1023, 1},
        SharedList{1024, 1, 1023}, SharedList{5, 2, 2}}) {
    EXPECT_EQ(SharedList::unpack(list.pack()), list);
  }
}

TEST(SharedList, NoMarkIsTheIdOfAnotherShardOrOfNone) {
  for (const std::uint16_t number :
       {std::uint16_t{1}, std::uint16_t{7}, std::uint16_t{4031}, kHubIdMax}) {
    const NodeId unmarked = node(number, kIndexMask);
    std::vector<NodeId> all{unmarked};
    for (std::size_t shard = 0; shard < kShardsMax; ++shard) {
      const NodeId marked =
          SharedList::marked(unmarked, ShardIndex{static_cast<std::uint8_t>(shard)});
      EXPECT_EQ(index_of(marked), index_of(unmarked));
      for (const NodeId other : all) EXPECT_NE(marked, other);
      all.push_back(marked);
    }
  }
}

/// A frame to 6.9, 7.1, 7.2, 7.3 and 8.1, of which 7.1 and 7.3 are shard 1's and 7.2 is shard 0's.
std::vector<std::byte> marked_frame() {
  const std::vector<NodeId> nodes{node(6, 9), node(7, 1), node(7, 2), node(7, 3), node(8, 1)};
  std::vector<std::byte> ids = ids_of(nodes);
  const SharedList list = find(nodes);
  SharedList::mark(ids.data(), 1, nodes[1], ShardIndex{1});
  SharedList::mark(ids.data(), 2, nodes[2], ShardIndex{0});
  SharedList::mark(ids.data(), 3, nodes[3], ShardIndex{1});
  proto::FrameHeader header;
  header.kind = proto::Kind::list;
  header.dst = list.pack();
  header.length = static_cast<std::uint32_t>(ids.size());
  std::vector<std::byte> frame(header.frame_size());
  proto::store_header(frame.data(), header);
  std::copy(ids.begin(), ids.end(), frame.begin() + proto::kHeaderSize);
  return frame;
}

TEST(SharedList, CountsThoseOfAShard) {
  const auto frame = marked_frame();
  const std::byte* const ids = frame.data() + proto::kHeaderSize;
  const SharedList list = SharedList::unpack(proto::load_header(frame.data()).dst);
  EXPECT_EQ(list.count_of(ShardIndex{0}, ids, kHub), 1u);
  EXPECT_EQ(list.count_of(ShardIndex{1}, ids, kHub), 2u);
  EXPECT_EQ(list.count_of(ShardIndex{2}, ids, kHub), 0u)
      << "7.x marked for it would look like 10.x";
}

TEST(SharedList, TellsWhatTheSenderWrote) {
  const auto frame = marked_frame();
  const SharedList list = SharedList::unpack(proto::load_header(frame.data()).dst);
  const SharedList::FrameStart start = list.as_sent(frame.data(), kHub);
  EXPECT_EQ(proto::load_header(start.data()).dst, 5u);
  EXPECT_EQ(proto::load_header(start.data()).length, 20u);
  const std::byte* const ids = start.data() + proto::kHeaderSize;
  const NodeId written[] = {node(6, 9), node(7, 1), node(7, 2), node(7, 3)};
  for (std::uint32_t i = 0; i < 4; ++i) EXPECT_EQ(SharedList::id_at(ids, i), written[i]);
}

TEST(SharedList, TellsOfAShortFrameWhatThereIs) {
  proto::FrameHeader header;
  header.kind = proto::Kind::list;
  header.length = 4;
  std::vector<std::byte> frame(header.frame_size());
  proto::store_header(frame.data(), header);
  SharedList::mark(frame.data() + proto::kHeaderSize, 0, node(7, 5), ShardIndex{63});
  const SharedList::FrameStart start = SharedList{1, 0, 1}.as_sent(frame.data(), kHub);
  EXPECT_EQ(SharedList::id_at(start.data() + proto::kHeaderSize, 0), node(7, 5));
  EXPECT_EQ(SharedList::id_at(start.data() + proto::kHeaderSize, 1), NodeId{});
}

}  // namespace
}  // namespace gimnet::hub
