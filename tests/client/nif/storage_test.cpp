#include "client/nif/storage.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "tests/client/nif/support/recording_host.hpp"

namespace gimnet::nif::test {
namespace {

TEST(Storage, AFrameIsTakenApartWhereItLies) {
  proto::FrameParts parts;
  parts.header.kind = proto::Kind::service;
  parts.header.dst = 3;
  parts.header.src = kPeerId;
  parts.header.lane = NIF_BULK;
  parts.header.flags = proto::kFlagReport | static_cast<std::uint8_t>(proto::Policy::drop);
  parts.key = 7;
  std::vector<std::byte> frame;
  add_frame(frame, parts, "payload");
  Slab* const slab = Slab::make();
  ASSERT_NE(slab, nullptr);
  std::memcpy(slab->bytes(), frame.data(), frame.size());
  nif_incoming in = incoming_of({slab, slab->bytes(), 99, frame.size()});
  EXPECT_EQ(in.kind, NIF_SERVICE);
  EXPECT_EQ(in.to, 3u);
  EXPECT_EQ(in.lane, NIF_BULK);
  EXPECT_EQ(in.policy, NIF_DROP);
  EXPECT_EQ(in.flags, NIF_FLAG_REPORT | NIF_FLAG_KEYED);
  EXPECT_EQ(in.key, 7u);
  EXPECT_EQ(in.arrival_ns, 99);
  EXPECT_EQ(payload_of(in), "payload");
  EXPECT_EQ(in.payload, slab->bytes() + frame.size() - 7) << "not copied";
  nif_release(&in);
  EXPECT_EQ(in.storage, nullptr);
  nif_release(&in);  // given back already: nothing happens
}

TEST(Storage, LivesAsLongAsItsLastReference) {
  Slab* const slab = Slab::make();
  EXPECT_TRUE(slab->is_only_reference());
  slab->add_reference();
  EXPECT_FALSE(slab->is_only_reference());
  slab->release();
  EXPECT_TRUE(slab->is_only_reference());
  slab->release();
}

}  // namespace
}  // namespace gimnet::nif::test
