#include "hub/data/fanout/pacer.hpp"

#include <gtest/gtest.h>

#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

using testing::EgressRig;
using testing::last_bytes_of;

TEST(LastFrames, AreFoundInEachRun) {
  EgressRig rig;
  LastFrames last;
  for (const std::uint32_t frames : {1u, 2u, 64u, 1'000u}) {
    std::vector<std::string> payloads;
    for (std::uint32_t i = 0; i < frames; ++i) payloads.emplace_back((i * 7 + frames) % 23, 'x');
    const hub::Run run = rig.run(payloads);
    last.begin(run, last_bytes_of(run));
    std::uint32_t expected = 0;
    for (std::uint32_t n = 1; n <= frames; ++n) {
      expected += static_cast<std::uint32_t>(proto::kHeaderSize + payloads[frames - n].size());
      ASSERT_EQ(last.bytes_of(n), expected) << n << " of " << frames;
    }
  }
}

}  // namespace
}  // namespace gimnet::hub
