#include "hub/network/state/record_store.hpp"

#include <gtest/gtest.h>

#include <array>

#include "base/endian.hpp"
#include "hub/crypto/hmac.hpp"
#include "tests/hub/network/state/support/hubs.hpp"

namespace gimnet::hub {
namespace {

using namespace test;
using std::chrono::minutes;
using Taken = RecordStore::Taken;

constexpr milliseconds kNow{1'000};

TEST(RecordOrder, IsBySequenceThenByInstance) {
  const auto newer = [](std::uint64_t sequence, std::uint64_t instance, std::uint64_t than_sequence,
                        std::uint64_t than_instance) {
    return is_newer(said(identity(1, instance), sequence),
                    said(identity(1, than_instance), than_sequence));
  };
  EXPECT_TRUE(newer(6, 1, 5, 9));
  EXPECT_FALSE(newer(5, 9, 6, 1));
  EXPECT_TRUE(newer(5, 2, 5, 1));
  EXPECT_FALSE(newer(5, 1, 5, 1)) << "the same";
  constexpr std::uint64_t kFar = std::uint64_t{1} << 32;
  EXPECT_TRUE(newer(5 + kFar, 1, 5, 1));
  EXPECT_FALSE(newer(5 + kFar + 1, 1, 5, 1)) << "from the future";
  EXPECT_TRUE(newer(5, 1, 5 + kFar + 1, 1));
}

TEST(RecordStoreTake, KeepsTheNewerPart) {
  RecordStore store;
  const auto hub = identity(1, 7);
  EXPECT_EQ(store.take(part(hub, 5), kNow), Taken::newer);
  EXPECT_EQ(store.take(part(hub, 5), kNow), Taken::known);
  EXPECT_EQ(store.take(part(hub, 4), kNow), Taken::known);
  EXPECT_EQ(store.take(part(identity(1, 8), 5), kNow), Taken::newer);
  EXPECT_EQ(store.find(hub.key)->head()->instance, proto::HubInstance{8});
  EXPECT_EQ(store.take(part(hub, 1, {}, 2), kNow), Taken::newer) << "another part";
  EXPECT_EQ(store.find(hub_key(2)), nullptr);
  EXPECT_EQ(store.all().size(), 2u);
}

TEST(RecordStoreTake, CountsOnlyPartsOfTheInstanceOfPart0) {
  RecordStore store;
  const auto counting = [&store] {
    std::vector<std::uint16_t> numbers;
    store.find(hub_key(1))->each_counting([&numbers](const StoredPart& each) {
      numbers.push_back(each.said.part);
    });
    return numbers;
  };
  const auto former = identity(1, 7);
  const auto present = identity(1, 8);
  store.take(part(former, 2, {}, 1), kNow);
  EXPECT_TRUE(counting().empty()) << "nobody knows which instance counts";
  store.take(part(former, 1), kNow);
  EXPECT_EQ(counting(), (std::vector<std::uint16_t>{0, 1}));
  store.take(part(present, 3), kNow);
  EXPECT_EQ(counting(), (std::vector<std::uint16_t>{0}));
  store.take(part(present, 4, {}, 1), kNow);
  EXPECT_EQ(counting(), (std::vector<std::uint16_t>{0, 1}));
}

TEST(RecordStoreTake, KeepsUnknownKeysForThoseWhoKnowThem) {
  proto::bitestream::Writer body;
  said(identity(1, 7), 5).write(body);
  body.put_text(20, "of a later version");
  const auto bytes = proto::assemble_control({proto::route::RecordPart::kOperation, 0}, body);
  const PartRef read = read_part(bytes);
  ASSERT_NE(read, nullptr);
  EXPECT_EQ(read->bytes, bytes);
  RecordStore store;
  store.take(read, kNow);
  EXPECT_EQ(store.all().front()->bytes, bytes);
}

TEST(RecordStoreTake, ReadsNoPartThatIsTooLargeOrMalformed) {
  const auto with_rest = [](std::size_t size) {
    proto::bitestream::Writer body;
    said(identity(1, 7), 5).write(body);
    body.put_opaque(20, std::vector<std::byte>(size, std::byte{1}));
    return proto::assemble_control({proto::route::RecordPart::kOperation, 0}, body);
  };
  // A value of more than 255 bytes has a length of two bytes.
  const std::size_t most = proto::route::kPartBytesMax - with_rest(1'000).size() + 1'000;
  EXPECT_NE(read_part(with_rest(most)), nullptr);
  EXPECT_EQ(read_part(with_rest(most + 1)), nullptr);
  EXPECT_EQ(read_part(proto::encode(proto::route::RecordsEnd{})), nullptr);
}

/// A record of hub id 5.
PartRef one_of_five(std::uint8_t unique, std::uint64_t sequence = 1) {
  return part({hub_key(5, unique), proto::HubInstance{1}, true}, sequence);
}

TEST(RecordStoreLimit, OfOneHubIdTheOneThatWasLostFirstGoes) {
  RecordStore store;
  for (std::uint8_t unique = 1; unique <= RecordStore::kRecordsOfOneId; ++unique) {
    EXPECT_EQ(store.take(one_of_five(unique), kNow + milliseconds{unique}), Taken::newer);
  }
  EXPECT_EQ(store.too_many(), 0u);
  store.set_linked({hub_key(5, 1)});
  store.set_reachable(std::vector{hub_key(5, 2)}, kNow);
  EXPECT_EQ(store.take(one_of_five(200), kNow + minutes(1)), Taken::newer);
  EXPECT_EQ(store.too_many(), 1u);
  EXPECT_NE(store.find(hub_key(5, 1)), nullptr) << "it is linked";
  EXPECT_NE(store.find(hub_key(5, 2)), nullptr) << "it can be reached";
  EXPECT_EQ(store.find(hub_key(5, 3)), nullptr);
  EXPECT_NE(store.find(hub_key(5, 4)), nullptr);
  EXPECT_EQ(store.take(one_of_five(4, 2), kNow), Taken::newer) << "one that is known";
  EXPECT_EQ(store.too_many(), 1u);
}

TEST(RecordStoreLimit, WhereAllOfOneHubIdCanBeReachedOnlyALinkedHubIsTaken) {
  RecordStore store;
  std::vector<proto::HubKey> all;
  for (std::uint8_t unique = 1; unique <= RecordStore::kRecordsOfOneId; ++unique) {
    store.take(one_of_five(unique), kNow);
    all.push_back(hub_key(5, unique));
  }
  store.set_reachable(all, kNow);
  EXPECT_EQ(store.take(one_of_five(200), kNow), Taken::too_many);
  EXPECT_EQ(store.too_many(), 1u);
  EXPECT_EQ(store.take(part(identity(6, 1), 1), kNow), Taken::newer) << "another hub id";
  store.set_linked({hub_key(5, 200)});
  EXPECT_EQ(store.take(one_of_five(200), kNow), Taken::newer);
  store.put_own(one_of_five(201));
  EXPECT_NE(store.find(hub_key(5, 201)), nullptr) << "others cannot take its place away";
}

TEST(RecordStoreLimit, RecordsOfLostHubsMakeRoomForOthers) {
  RecordStore store;
  const auto nth = [](std::uint64_t number) {
    proto::HubKey key{HubId{static_cast<std::uint16_t>(100 + number % 3'000)}, {}};
    store_le(reinterpret_cast<std::byte*>(key.unique.bytes.data()), number);
    auto record = said({key, proto::HubInstance{1}, true}, 1);
    record.name = std::string(255, 'n');
    return make_part(record);
  };
  store.take(part(identity(1, 1), 1), kNow);
  store.take(part(identity(2, 1), 1), kNow);
  store.set_reachable(std::vector{hub_key(1)}, kNow);
  store.set_linked({hub_key(2)});
  std::uint64_t taken = 0;
  while (store.too_many() == 0) {
    ASSERT_EQ(store.take(nth(taken), kNow + milliseconds(taken)), Taken::newer);
    ++taken;
    ASSERT_LT(taken, RecordStore::kUnreachableBytesMax / 256);
  }
  EXPECT_GT(taken, RecordStore::kUnreachableBytesMax / 1'024) << "as many as have room";
  EXPECT_NEAR(static_cast<double>(store.records().size()), static_cast<double>(taken) / 2, 4);
  EXPECT_NE(store.find(nth(taken - 1)->said.hub), nullptr) << "the newest is there";
  EXPECT_EQ(store.find(nth(0)->said.hub), nullptr);
  EXPECT_NE(store.find(hub_key(1)), nullptr) << "it can be reached";
  EXPECT_NE(store.find(hub_key(2)), nullptr) << "it is linked";
  EXPECT_EQ(store.reachable().size(), 1u);
}

TEST(RecordStoreForget, ThrowsAwayHubsThatCouldNotBeReachedForTenMinutes) {
  RecordStore store;
  store.take(part(identity(1, 7), 1), kNow);
  store.take(part(identity(2, 7), 1), kNow);
  store.set_reachable(std::vector{hub_key(1)}, kNow);
  store.forget(kNow + minutes(10) - milliseconds(1));
  EXPECT_EQ(store.records().size(), 2u);
  store.forget(kNow + minutes(10));
  EXPECT_EQ(store.find(hub_key(2)), nullptr);
  EXPECT_NE(store.find(hub_key(1)), nullptr);
  store.set_reachable({}, kNow + minutes(20));
  store.forget(kNow + minutes(30) - milliseconds(1));
  EXPECT_NE(store.find(hub_key(1)), nullptr) << "the time begins when it is lost";
}

TEST(RecordStoreNear, AreHubsThatAReachableOneNames) {
  RecordStore store;
  store.set_linked({hub_key(4)});
  store.take(part(identity(1, 7), 1, {{hub_key(2), 10}, {hub_key(3), 10}}), kNow);
  store.take(part(identity(2, 7), 1, {{hub_key(1), 10}}), kNow);
  store.take(part(identity(3, 7), 1, {{hub_key(5), 10}}), kNow);
  EXPECT_FALSE(store.is_near(hub_key(1)));
  store.set_reachable(std::vector{hub_key(1), hub_key(2)}, kNow);
  EXPECT_TRUE(store.is_near(hub_key(1)));
  EXPECT_TRUE(store.is_near(hub_key(2)));
  EXPECT_TRUE(store.is_near(hub_key(3))) << "hub 1 names it";
  EXPECT_TRUE(store.is_near(hub_key(4))) << "it is linked";
  EXPECT_FALSE(store.is_near(hub_key(5))) << "hub 3 cannot be reached";
}

TEST(RecordDigest, IsThatOfTheDocument) {
  RecordStore store;
  const auto hub = identity(0x0102, 0x1112131415161718);
  store.take(part(hub, 0x2122232425262728), kNow);
  EXPECT_EQ(store.digest(), 0u) << "it cannot be reached";
  store.set_reachable(std::vector{hub.key}, kNow);
  std::array<std::byte, 36> text{};
  store_le(text.data(), std::uint16_t{0x0102});
  text[17] = std::byte{0x02};  // hub_key()
  store_le(text.data() + 20, std::uint64_t{0x2122232425262728});
  store_le(text.data() + 28, hub.instance.value());
  EXPECT_EQ(store.digest(), load_le<std::uint64_t>(sha256(text).data()));
}

TEST(RecordDigest, DiffersIfAPartThatCountsDoes) {
  const auto digest = [](const std::vector<PartRef>& parts) {
    RecordStore store;
    for (const PartRef& each : parts) store.take(each, kNow);
    store.set_reachable(std::vector{hub_key(1), hub_key(2)}, kNow);
    return store.digest();
  };
  const auto hub = identity(1, 7);
  const auto other = identity(2, 7);
  const auto base = digest({part(hub, 1), part(other, 1)});
  EXPECT_EQ(digest({part(other, 1), part(hub, 1)}), base) << "in whichever order they come";
  EXPECT_NE(digest({part(hub, 2), part(other, 1)}), base);
  EXPECT_NE(digest({part(hub, 1)}), base);
  EXPECT_NE(digest({part(hub, 1), part(other, 1), part(hub, 1, {}, 1)}), base);
  EXPECT_EQ(digest({part(hub, 1), part(other, 1), part(identity(1, 6), 9, {}, 1)}), base)
      << "a part of a former instance does not count";
}

}  // namespace
}  // namespace gimnet::hub
