#include "tools/gimnet/impair.hpp"

#include <gtest/gtest.h>

namespace gimnet::tool {
namespace {

using impair::FaultProxy;
using impair::Impairment;

constexpr std::int64_t kMs = 1'000'000;

class ImpairTest : public testing::Test {
 protected:
  ImpairTest() {
    auto opened = FaultProxy::open(*net::parse_address("tcp://127.0.0.1:0", 0),
                                   *net::parse_address("tcp://127.0.0.1:1"), {}, 1);
    EXPECT_TRUE(opened);
    proxy_ = std::move(*opened);
  }
  std::string say(std::string_view line) { return obey(*proxy_, line); }

  std::unique_ptr<FaultProxy> proxy_;
};

TEST_F(ImpairTest, ChangesOneSettingAndLeavesTheOthers) {
  EXPECT_EQ(say("delay 80ms"), "ok");
  EXPECT_EQ(say("  rate\t1MB \r"), "ok");
  EXPECT_EQ(proxy_->impairment(), (Impairment{.delay_ns = 80 * kMs, .rate = 1'000'000}));
  EXPECT_EQ(say("delay off"), "ok");
  EXPECT_EQ(proxy_->impairment(), Impairment{.rate = 1'000'000});
}

TEST_F(ImpairTest, TakesItsOrders) {
  for (const char* line :
       {"", "stall", "stall up", "stall down 5ms", "stall 5ms", "go", "cut", "refuse", "accept"})
    EXPECT_EQ(say(line), "ok") << line;
  EXPECT_EQ(say("status"),
            "{\"connections\":0,\"accepted\":0,\"refused\":0,\"cut\":0,\"stalls\":0,\"up_bytes\":0,"
            "\"down_bytes\":0}");
}

TEST_F(ImpairTest, SaysWhatIsWrongAndChangesNothing) {
  const auto tells = [&](std::string_view line, std::string_view part) {
    const std::string answer = say(line);
    EXPECT_TRUE(answer.starts_with("error: ")) << line;
    EXPECT_NE(answer.find(part), std::string::npos) << answer;
  };
  tells("dealy 80ms", "there is no setting 'dealy'");
  tells("delay 80", "'80' is no time");
  tells("delay", "'delay' is no order");
  tells("stall sideways", "'sideways' is no time");
  tells("stall up 5ms more", "stall takes [up|down] [TIME]");
  tells("cut now please", "is no order");
  EXPECT_EQ(proxy_->impairment(), Impairment{});
}

}  // namespace
}  // namespace gimnet::tool
