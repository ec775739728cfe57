#include "proto/frame/extensions.hpp"

#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "proto/frame/frame_parser.hpp"
#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto {
namespace {

using test::Bytes;
using test::from_hex;
using test::load_vector;

constexpr std::int64_t kNewYear = 1767225600000000000;

Bytes extensions_of(const std::string& vector) {
  const auto bytes = load_vector(vector);
  return test::to_bytes(parse_frame(bytes, Origin::node)->extensions);
}

TEST(Extensions, AreReadInOrder) {
  const auto bytes = from_hex("00 01 ff  07 00  02 02 aa bb");
  ExtensionReader reader(bytes);
  EXPECT_EQ(reader.next()->value.size(), 1u);
  const auto unknown = reader.next();
  EXPECT_EQ(static_cast<int>(unknown->type), 7);
  EXPECT_TRUE(unknown->value.empty());
  EXPECT_EQ(reader.next()->value.size(), 2u);
  EXPECT_FALSE(reader.next());
  EXPECT_FALSE(reader.failed());
}

TEST(Extensions, AreValidWhereEachFits) {
  EXPECT_TRUE(valid_extensions({}));
  EXPECT_TRUE(valid_extensions(from_hex("00 00")));
  EXPECT_TRUE(valid_extensions(from_hex("01 01 00")))
      << "a TRACE of a wrong size is carried like an unknown one";
  EXPECT_FALSE(valid_extensions(from_hex("00")));
  EXPECT_FALSE(valid_extensions(from_hex("00 02 00")));
  EXPECT_FALSE(valid_extensions(from_hex("00 00 00")));
  EXPECT_FALSE(valid_extensions(from_hex("00 ff")));
}

TEST(Extensions, StopAtOneThatDoesNotFit) {
  const auto bytes = from_hex("00 00 00 05 00");
  ExtensionReader reader(bytes);
  EXPECT_TRUE(reader.next());
  EXPECT_FALSE(reader.next());
  EXPECT_TRUE(reader.failed());
  EXPECT_FALSE(reader.next());
}

TEST(Age, IsFound) {
  EXPECT_EQ(find_age(extensions_of("frame/unicast_age")), (Age{kNewYear, 250}));
  EXPECT_EQ(find_age(extensions_of("frame/unicast_trace")), std::nullopt);
  EXPECT_EQ(find_age(from_hex("02 01 00")), std::nullopt) << "of a wrong size";
}

TEST(Age, EndsAfterItsTime) {
  const Age age{kNewYear, 250};
  EXPECT_FALSE(too_old(age, kNewYear));
  EXPECT_FALSE(too_old(age, kNewYear + 250'000'000));
  EXPECT_TRUE(too_old(age, kNewYear + 250'000'001));
  EXPECT_FALSE(too_old(age, kNewYear - 1)) << "clocks differ";
}

TEST(Age, FromTheFutureBeginsNow) {
  for (const std::int64_t ahead_ns : {std::int64_t{3'600'000'000'000}, std::int64_t{1}}) {
    auto extensions = extensions_of("frame/unicast_age");
    adopt_origin(extensions, 0, kNewYear - ahead_ns);
    EXPECT_EQ(find_age(extensions), (Age{kNewYear - ahead_ns, 250}));
  }
  auto extensions = extensions_of("frame/unicast_age");
  adopt_origin(extensions, 0, kNewYear);
  adopt_origin(extensions, 0, kNewYear + 1);
  EXPECT_EQ(find_age(extensions), (Age{kNewYear, 250})) << "of now, and of the past";
  auto odd = from_hex("02 01 00");
  adopt_origin(odd, 0, 0);
  EXPECT_EQ(odd, from_hex("02 01 00")) << "of a wrong size";
}

TEST(Age, OfAnotherClockIsMovedToThisOne) {
  constexpr std::int64_t kHour = 3'600'000'000'000;
  const std::int64_t later = kNewYear + kHour + 1;
  for (const std::int64_t ahead_ns : {-kHour, std::int64_t{5}, kHour}) {
    auto extensions = extensions_of("frame/unicast_age");
    adopt_origin(extensions, ahead_ns, later);
    EXPECT_EQ(find_age(extensions), (Age{kNewYear - ahead_ns, 250}));
  }
  auto of_unknown = extensions_of("frame/unicast_age");
  adopt_origin(of_unknown, std::nullopt, later);
  EXPECT_EQ(find_age(of_unknown), (Age{later, 250})) << "it ages from now on";
  auto far = extensions_of("frame/unicast_age");
  adopt_origin(far, std::numeric_limits<std::int64_t>::min(), later);
  EXPECT_EQ(find_age(far), (Age{later, 250})) << "no time has that distance";
}

TEST(Age, SurvivesAnyTime) {
  constexpr auto kFirst = std::numeric_limits<std::int64_t>::min();
  constexpr auto kLast = std::numeric_limits<std::int64_t>::max();
  EXPECT_TRUE(too_old({kFirst, UINT32_MAX}, kLast));
  EXPECT_FALSE(too_old({kLast, 0}, kFirst));
}

TEST(Trace, IsFound) {
  const auto extensions = extensions_of("frame/unicast_trace");
  const auto trace = find_trace(extensions);
  ASSERT_TRUE(trace);
  EXPECT_EQ(trace->slots(), 2u);
  EXPECT_EQ(trace->used(), 1u);
  EXPECT_EQ(trace->slot(0), (TraceSlot{HubId{7}, kNewYear, kNewYear + 1500}));
}

TEST(Trace, IsFilledInPlaceUntilItIsFull) {
  auto extensions = extensions_of("frame/unicast_trace");
  const TraceSlot mine{HubId{9}, kNewYear + 2000, kNewYear + 3000};
  EXPECT_TRUE(fill_trace(extensions, mine));
  const auto trace = find_trace(extensions);
  EXPECT_EQ(trace->used(), 2u);
  EXPECT_EQ(trace->slot(1), mine);
  const Bytes full = extensions;
  EXPECT_FALSE(fill_trace(extensions, mine));
  EXPECT_EQ(extensions, full);
}

TEST(Trace, IsStampedAtDepartureByItsHubOnly) {
  std::array<std::byte, 64> memory{};
  ExtensionWriter writer(memory);
  ASSERT_TRUE(writer.add_trace(2));
  const std::span<std::byte> extensions(memory.data(), writer.written().size());
  EXPECT_FALSE(stamp_departure(extensions, HubId{7}, kNewYear)) << "no slot is filled yet";
  ASSERT_TRUE(fill_trace(extensions, {HubId{7}, kNewYear, kNewYear}));
  EXPECT_FALSE(stamp_departure(extensions, HubId{8}, kNewYear + 5));
  EXPECT_TRUE(stamp_departure(extensions, HubId{7}, kNewYear + 5));
  EXPECT_EQ(find_trace(extensions)->slot(0), (TraceSlot{HubId{7}, kNewYear, kNewYear + 5}));
  EXPECT_FALSE(stamp_departure({}, HubId{7}, kNewYear));
}

TEST(Trace, IsNotFilledWhereItsCountLies) {
  auto extensions = extensions_of("frame/unicast_trace");
  extensions[3 + kExtensionHeadSize] = std::byte{200};
  const Bytes before = extensions;
  EXPECT_FALSE(fill_trace(extensions, {}));
  EXPECT_EQ(extensions, before);
  EXPECT_EQ(find_trace(extensions)->used(), 2u) << "never more than there are slots";
}

TEST(Trace, OfAWrongSizeIsNone) {
  auto bytes = from_hex("01 05 00 00 00 00 00");
  EXPECT_FALSE(find_trace(bytes));
  EXPECT_FALSE(fill_trace(bytes, {}));
}

TEST(ExtensionWriter, WritesTheVectors) {
  std::array<std::byte, 64> memory{};
  ExtensionWriter age(memory);
  ASSERT_TRUE(age.add_age({kNewYear, 250}));
  EXPECT_EQ(test::to_bytes(age.written()), extensions_of("frame/unicast_age"));

  ExtensionWriter trace(memory);
  ASSERT_TRUE(trace.add(ExtensionType::pad, from_hex("00")));
  ASSERT_TRUE(trace.add_trace(2));
  ASSERT_TRUE(fill_trace(std::span(memory).first(trace.written().size()),
                         {HubId{7}, kNewYear, kNewYear + 1500}));
  EXPECT_EQ(test::to_bytes(trace.written()), extensions_of("frame/unicast_trace"));
}

TEST(ExtensionWriter, WritesNothingWithoutRoom) {
  std::array<std::byte, kExtensionHeadSize + kAgeSize> memory{};
  ExtensionWriter small{std::span(memory).first(memory.size() - 1)};
  EXPECT_FALSE(small.add_age({}));
  EXPECT_TRUE(small.written().empty());
  ExtensionWriter exact(memory);
  EXPECT_TRUE(exact.add_age({}));
  EXPECT_FALSE(exact.add(ExtensionType::pad, {}));
}

TEST(ExtensionWriter, FitsTheLongestTrace) {
  std::array<std::byte, 300> memory{};
  ExtensionWriter writer(memory);
  ASSERT_TRUE(writer.add_trace(kTraceSlotsMax));
  EXPECT_EQ(find_trace(writer.written())->slots(), kTraceSlotsMax);
}

}  // namespace
}  // namespace gimnet::proto
