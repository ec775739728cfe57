#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "client/nif/inbound.hpp"
#include "tests/client/nif/support/fake_hub.hpp"
#include "tests/client/nif/support/recording_host.hpp"

// Tests the event of a message that is larger than this end takes.

namespace gimnet::nif::test {
namespace {

TEST(Inbound, GivesOutTheBeginningOfAMessageThatIsTooLarge) {
  std::vector<std::byte> bytes;
  proto::FrameParts first;
  first.header.kind = proto::Kind::service;
  first.header.src = kPeerId;
  first.header.dst = 42;
  first.key = 99;
  first.header.lane = 2;
  first.fragment = proto::FragmentHeader{1, 0, 65u << 20};
  const std::string text = pattern(1000);
  add_frame(bytes, first, text);
  first.fragment->offset = 1000;
  add_frame(bytes, first, text);
  Receiving receiving;
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  ASSERT_EQ(receiving.host.items.size(), 1u) << "once a message";
  const nif_incoming& gap = receiving.host.items[0];
  EXPECT_EQ(gap.type, std::uint32_t{NIF_GAP});
  EXPECT_EQ(gap.reason, std::uint32_t{NIF_DROP_TOO_LARGE});
  EXPECT_EQ(gap.count, 1u);
  EXPECT_EQ(gap.from, kPeerId);
  EXPECT_EQ(gap.to, 42u);
  EXPECT_EQ(gap.kind, NIF_SERVICE);
  EXPECT_EQ(gap.lane, 2u);
  EXPECT_EQ(gap.flags, NIF_FLAG_KEYED);
  EXPECT_EQ(gap.key, 99u);
  EXPECT_EQ(payload_of(gap), text.substr(0, 64));
  EXPECT_EQ(gap.extensions, nullptr);
}

}  // namespace
}  // namespace gimnet::nif::test
