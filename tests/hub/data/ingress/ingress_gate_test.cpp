#include "hub/data/ingress/ingress_gate.hpp"

#include <gtest/gtest.h>

#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::Kind;
using testing::EgressRig;
using testing::TestFrame;

class IngressGateTest : public ::testing::Test {
 protected:
  IngressGateTest() { state.node = NodeId{7u << 20 | 1}; }
  Admission admit(std::vector<std::byte>& bytes, std::uint32_t frames = 1) {
    view = {bytes.data(), static_cast<std::uint32_t>(bytes.size()), frames};
    return gate.admit(state, bytes.data(), view, now_ms);
  }
  Admission admit(const std::string& payload, const TestFrame& frame) {
    last = EgressRig::bytes(payload, frame);
    return admit(last);
  }
  Limits limits;
  Tally tally;
  IngressGate gate{limits, tally};
  IngressState state;
  proto::RunView view;
  std::vector<std::byte> last;
  std::uint64_t now_ms = 10'000;
};

TEST_F(IngressGateTest, SendsEachKindItsWay) {
  EXPECT_EQ(admit("x", {}), Admission::data);
  EXPECT_EQ(admit("x", {.kind = Kind::group}), Admission::data);
  EXPECT_EQ(admit("x", {.kind = Kind::taken}), Admission::data);
  EXPECT_EQ(admit("x", {.kind = static_cast<Kind>(15)}), Admission::data);
  EXPECT_EQ(admit("x", {.kind = Kind::flow}), Admission::flow);
  EXPECT_EQ(admit("x", {.kind = Kind::link}), Admission::link);
  EXPECT_EQ(admit("x", {.kind = Kind::ns}), Admission::control);
  EXPECT_EQ(admit("x", {.kind = Kind::ctrl}), Admission::control);
  EXPECT_EQ(admit("x", {.kind = Kind::report}), Admission::malformed);
  EXPECT_EQ(admit("x", {.kind = Kind::route}), Admission::malformed);
  EXPECT_EQ(admit("x", {.kind = static_cast<Kind>(20)}), Admission::malformed);
}

TEST_F(IngressGateTest, RefusesFlagsWithWhichARequestWouldBeMisread) {
  for (const Kind kind : {Kind::flow, Kind::link, Kind::ns, Kind::ctrl}) {
    for (const std::uint8_t flags : {proto::kFlagFragment, proto::kFlagKeyed}) {
      EXPECT_EQ(admit("0123456789abcdef", {.kind = kind, .flags = flags}), Admission::malformed);
      EXPECT_EQ(state.error, proto::FrameError::flag_not_allowed);
    }
  }
  const std::string nothing("\0\0", 2);
  EXPECT_EQ(admit(nothing + "x", {.kind = Kind::ns, .flags = proto::kFlagExt}), Admission::control);
  EXPECT_EQ(admit("\x05", {.kind = Kind::ns, .flags = proto::kFlagExt}), Admission::malformed);
  EXPECT_EQ(state.error, proto::FrameError::ext_too_short);
  EXPECT_EQ(admit(nothing + "x", {.kind = Kind::flow, .flags = proto::kFlagExt}),
            Admission::malformed);
  EXPECT_EQ(admit("x", {.kind = Kind::ctrl, .flags = 3 | proto::kFlagReport}), Admission::control);
}

TEST_F(IngressGateTest, LooksAtTheSourceOfEveryFrame) {
  EXPECT_EQ(admit("x", {}), Admission::data);
  EXPECT_EQ(admit("x", {.src = 2}), Admission::wrong_source) << "also where all else is as before";
  EXPECT_EQ(admit("x", {}), Admission::data);
  EXPECT_EQ(admit("x", {.kind = Kind::ns, .src = 2}), Admission::wrong_source);
}

TEST_F(IngressGateTest, OnlyFlowAndLinkMayGoWithoutASource) {
  for (const Kind kind : {Kind::unicast, Kind::ns, Kind::flow, Kind::link}) {
    auto bytes = EgressRig::bytes("x", {.kind = kind});
    std::memset(bytes.data() + 8, 0, 4);
    const Admission admitted = admit(bytes);
    EXPECT_EQ(admitted == Admission::wrong_source, kind == Kind::unicast || kind == Kind::ns);
  }
}

// Found by fuzzing: these bits stood for "nothing admitted yet", and so passed.
TEST_F(IngressGateTest, RefusesAFrameOfAllOnes) {
  EXPECT_EQ(admit("x", {.kind = static_cast<Kind>(255), .flags = 0xFF, .lane = 0xFF}),
            Admission::malformed);
  auto bytes = EgressRig::bytes("x", {.kind = static_cast<Kind>(255), .flags = 0xFF, .lane = 0xFF});
  bytes[14] = std::byte{0xFF};
  EXPECT_EQ(admit(bytes), Admission::malformed);
  EXPECT_EQ(admit("x", {.flags = proto::kFlagKeyed}), Admission::malformed);
  EXPECT_EQ(admit(bytes), Admission::malformed);
}

TEST_F(IngressGateTest, ShortensARunToTheFramesWithAKey) {
  const TestFrame keyed{.flags = proto::kFlagKeyed};
  std::vector<std::byte> run;
  for (const char* payload : {"12345678", "123456789", "1234567", "12345678"}) {
    const auto frame = EgressRig::bytes(payload, keyed);
    run.insert(run.end(), frame.begin(), frame.end());
  }
  EXPECT_EQ(admit(run, 4), Admission::data);
  EXPECT_EQ(view.frames, 2u);
  EXPECT_EQ(view.size, 2 * proto::kHeaderSize + 17);
  EXPECT_EQ(admit("1234567", keyed), Admission::malformed);
  EXPECT_EQ(state.error, proto::FrameError::key_too_short);
}

TEST_F(IngressGateTest, MovesTooMuchRealTimeToTheNormalLane) {
  limits.lane0_bytes_per_s = 10'000;  // 1,000 in 100 ms
  const TestFrame real_time{.lane = 0};
  const std::string half(500 - proto::kHeaderSize, 'x');
  const auto lane = [&] { return static_cast<int>(last[15]); };
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(admit(half, real_time), Admission::data);
    EXPECT_EQ(lane(), 0) << "exactly the limit";
  }
  EXPECT_EQ(admit("", real_time), Admission::data);
  EXPECT_EQ(lane(), 1) << "beyond it";
  EXPECT_EQ(tally.lane0_demoted, 1u);
  now_ms += 999;
  EXPECT_EQ(admit("", real_time), Admission::data);
  EXPECT_EQ(lane(), 1) << "until it was below the limit for a second";
  now_ms += 1;
  EXPECT_EQ(admit("", real_time), Admission::data);
  EXPECT_EQ(lane(), 0);
  EXPECT_EQ(admit("", {.lane = 2}), Admission::data);
  EXPECT_EQ(lane(), 2);
}

/// Fragments in lane 0, with 1,000 bytes in 100 ms.
class RealTimeFragmentTest : public IngressGateTest {
 protected:
  RealTimeFragmentTest() { limits.lane0_bytes_per_s = 10'000; }
  /// The lane of a fragment of so many payload bytes.
  int lane(std::uint32_t message, std::uint32_t offset, std::uint32_t total, std::uint32_t size) {
    std::vector<std::byte> header(proto::kFragmentHeaderSize);
    proto::store_fragment_header(header.data(), {message, offset, total});
    const std::string text(reinterpret_cast<const char*>(header.data()), header.size());
    EXPECT_EQ(admit(text + std::string(size, 'x'), {.flags = proto::kFlagFragment, .lane = 0}),
              Admission::data);
    return static_cast<int>(last[15]);
  }
  void spend_all() {
    EXPECT_EQ(admit(std::string(1'001 - proto::kHeaderSize, 'x'), {.lane = 0}), Admission::data);
    EXPECT_EQ(static_cast<int>(last[15]), 1);
  }
  static constexpr std::uint32_t kHeaders = proto::kHeaderSize + proto::kFragmentHeaderSize;
};

TEST_F(RealTimeFragmentTest, AMessageCountsWholeWhenItBegins) {
  const std::uint32_t total = 1'000 - kHeaders;
  EXPECT_EQ(lane(1, 0, total, 100), 0) << "exactly the limit";
  EXPECT_EQ(lane(2, 0, 10, 5), 1) << "beyond it";
  EXPECT_EQ(lane(1, 100, total, 500), 0) << "was counted";
  now_ms += 2'000;
  EXPECT_EQ(lane(2, 5, 10, 5), 1) << "a message is moved whole";
  EXPECT_EQ(lane(1, 600, total, total - 600), 0);
  EXPECT_EQ(admit("", {.lane = 0}), Admission::data);
  EXPECT_EQ(static_cast<int>(last[15]), 0) << "its rest counted for nothing";
}

TEST_F(RealTimeFragmentTest, AMessageThatIsTooMuchByItselfIsMovedAlone) {
  const std::uint32_t total = 1'001 - kHeaders;
  EXPECT_EQ(lane(1, 0, total, 100), 1);
  EXPECT_EQ(lane(2, 0, 100, 50), 0);
  EXPECT_EQ(lane(1, 100, total, total - 100), 1);
  EXPECT_EQ(lane(2, 50, 100, 50), 0);
}

TEST_F(RealTimeFragmentTest, FragmentsWithoutABeginningCountLikeOtherFrames) {
  const std::uint32_t size = 500 - kHeaders;
  EXPECT_EQ(lane(1, 1'000, 1 << 30, size), 0);
  EXPECT_EQ(lane(1, 2'000, 1 << 30, size), 0) << "exactly the limit";
  EXPECT_EQ(lane(1, 3'000, 1 << 30, 1), 1) << "beyond it";
  EXPECT_EQ(tally.lane0_demoted, 1u);
}

TEST_F(RealTimeFragmentTest, MessagesThatNeverEndKeepNobodysPlace) {
  spend_all();
  for (std::uint32_t i = 0; i < 2 * RealTimeMessages::kMessagesMax; ++i)
    EXPECT_EQ(lane(i, 0, 900, 100), 1);
  for (std::uint32_t i = 100; i < 110; ++i) {
    EXPECT_EQ(lane(i, 0, 200, 100), 1);
    EXPECT_EQ(lane(i, 100, 200, 100), 1);
  }
}

TEST_F(RealTimeFragmentTest, NeitherRepeatsNorTinyFragmentsGoForWhatWasCounted) {
  EXPECT_EQ(lane(1, 0, 200, 100), 0);
  spend_all();
  EXPECT_EQ(lane(1, 100, 200, 50), 0);
  // 2 x 228 bytes may go in all, of which 128 and 78 have.
  EXPECT_EQ(lane(1, 100, 200, 50), 0);
  EXPECT_EQ(lane(1, 100, 200, 50), 0);
  EXPECT_EQ(lane(1, 100, 200, 50), 0);
  EXPECT_EQ(lane(1, 100, 200, 50), 1);
  EXPECT_EQ(lane(1, 150, 200, 50), 1);
}

TEST_F(RealTimeFragmentTest, AMessageOfOneFragmentIsAFrame) {
  EXPECT_EQ(lane(1, 0, 500 - kHeaders, 500 - kHeaders), 0);
  EXPECT_EQ(lane(2, 0, 500 - kHeaders, 500 - kHeaders), 0) << "exactly the limit";
  EXPECT_EQ(lane(3, 0, 1, 1), 1) << "beyond it";
}

}  // namespace
}  // namespace gimnet::hub
