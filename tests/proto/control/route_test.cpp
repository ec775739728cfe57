#include "proto/control/route.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "proto/control/names.hpp"
#include "tests/proto/control/support/ns_vectors.hpp"

namespace gimnet::proto::route {
namespace {

/// Bytes first, first + 1, ... as in the vectors.
UniqueId unique_id(std::uint8_t first) {
  UniqueId unique;
  std::iota(unique.bytes.begin(), unique.bytes.end(), first);
  return unique;
}

RecordPart record_of_the_vector() {
  RecordPart record;
  record.hub = {HubId{7}, unique_id(0x10)};
  record.instance = HubInstance{0x1122334455667788};
  record.configured = true;
  record.sequence = 5;
  record.behind = HubInstance{0x99};
  record.name = "lab";
  record.version = "0.1.0";
  record.neighbours = {{{HubId{2}, unique_id(0x20)}, 10}, {{HubId{9}, unique_id(0x30)}, 60}};
  return record;
}

Result<RecordPart> again(const RecordPart& record) { return decode<RecordPart>(encode(record)); }

TEST(RouteMessages, AreDecodedAndWrittenAsTheVectorsSay) {
  test::expect_request("route/record", 0, record_of_the_vector());
  RecordPart empty;
  empty.hub = {HubId{7}, unique_id(0x10)};
  empty.instance = HubInstance{0x1122334455667788};
  empty.configured = true;
  empty.part = 1;
  empty.sequence = 6;
  test::expect_request("route/record_empty_part", 0, empty);
  test::expect_request("route/records_end", 0, RecordsEnd{});
  constexpr std::int64_t kTime = 1767225600000000000;
  test::expect_request(
      "route/keep_alive", 0,
      KeepAlive{kTime, kTime - 15'000'000, kTime - 10'000'000, 40, 0x0123456789abcdef, 20});
}

TEST(RouteRecord, OfAllFieldsReadsAsItWasWritten) {
  RecordPart record = record_of_the_vector();
  record.features = 1;
  record.features_required = 2;
  EXPECT_EQ(*again(record), record);
  record.part = kPartsMax - 1;
  const auto other_part = again(record);
  EXPECT_EQ(other_part->name, "") << "only part 0 has a name";
  EXPECT_EQ(other_part->behind, HubInstance{});
  EXPECT_EQ(other_part->features, 0u);
  EXPECT_EQ(other_part->neighbours, record.neighbours);
}

TEST(RouteRecord, HasAtMostSoManyPartsAndNeighbours) {
  RecordPart record = record_of_the_vector();
  record.part = kPartsMax;
  EXPECT_FALSE(again(record));

  record.part = 0;
  record.name.assign(kNameBytesMax, 'n');
  record.version.assign(kRemarkBytesMax, 'v');
  record.neighbours.clear();
  for (std::uint16_t hub = 1; hub <= kNeighboursMax; ++hub) {
    record.neighbours.push_back({{HubId{hub}, unique_id(0)}, 65'535});
  }
  EXPECT_EQ(*again(record), record);
  EXPECT_LE(2 * encode(record).size(), kPartBytesMax);
  bitestream::Writer body;
  body.put_u16(1, 7);
  body.put_opaque(2, std::vector<std::byte>(16, std::byte{1}));
  body.put_u64(3, 1);
  body.put_u64(6, 1);
  body.put_opaque(12, std::vector<std::byte>((kNeighboursMax + 1) * 20, std::byte{1}));
  EXPECT_FALSE(decode<RecordPart>(assemble_control({RecordPart::kOperation, 0}, body)));
}

TEST(RouteRecord, NamesHubsOnly) {
  for (const std::uint16_t hub : {std::uint16_t{0}, std::uint16_t{4095}}) {
    RecordPart record = record_of_the_vector();
    record.hub.hub = HubId{hub};
    EXPECT_FALSE(again(record)) << hub;
    record = record_of_the_vector();
    record.neighbours = {{{HubId{hub}, unique_id(1)}, 10}};
    EXPECT_FALSE(again(record)) << hub;
    record.neighbours = {{{HubId{kHubIdMax}, unique_id(1)}, 10}};
    EXPECT_TRUE(again(record));
  }
}

TEST(RouteRecord, HasNeighboursThatAscendAndCostSomething) {
  RecordPart record = record_of_the_vector();
  std::swap(record.neighbours[0], record.neighbours[1]);
  EXPECT_FALSE(again(record));
  record.neighbours[0] = record.neighbours[1];
  EXPECT_FALSE(again(record)) << "the same hub twice";
  record.neighbours[1].hub.unique = unique_id(0x21);
  EXPECT_TRUE(again(record)) << "two hubs with one hub id";
  record.neighbours[1].cost = 0;
  EXPECT_FALSE(again(record));
}

TEST(RouteRecord, RefusesAUniqueIdAndAListOfNeighboursThatAreCut) {
  for (const std::size_t size : {std::size_t{0}, std::size_t{15}, std::size_t{16}}) {
    for (const std::size_t list : {std::size_t{0}, std::size_t{19}, std::size_t{20}}) {
      bitestream::Writer body;
      body.put_u16(1, 7);
      body.put_opaque(2, std::vector<std::byte>(size, std::byte{1}));
      body.put_u64(3, 1);
      body.put_u64(6, 1);
      body.put_opaque(12, std::vector<std::byte>(list, std::byte{1}));
      EXPECT_EQ(decode<RecordPart>(assemble_control({RecordPart::kOperation, 0}, body)).has_value(),
                size == 16 && list != 19)
          << size << " " << list;
    }
  }
}

TEST(RouteKeepAlive, NeedsCountAndDigest) {
  EXPECT_EQ(*decode<KeepAlive>(encode(KeepAlive{})), KeepAlive{});
  EXPECT_FALSE(decode<KeepAlive>(test::from_hex("03 00 00 00")));
}

}  // namespace
}  // namespace gimnet::proto::route
