#include "client/nif/dial_plan.hpp"

#include <gtest/gtest.h>

namespace gimnet::nif {
namespace {

using proto::GoodbyeCode;

constexpr std::int64_t kBroke = 1'000'000'000'000;
constexpr std::int64_t kGrace = 3'000'000'000;

net::Address tcp(std::uint16_t port) {
  net::Address address;
  address.host = "127.0.0.1";
  address.port = port;
  return address;
}

Options options(bool reconnect, bool dials_to_resume = false) {
  Options options;
  options.addresses = {tcp(1), tcp(2), tcp(3)};
  options.reconnect = reconnect;
  options.dials_to_resume = dials_to_resume;
  return options;
}

SessionTerms kept_session() {
  SessionTerms session;
  session.resume = true;
  session.grace_ns = kGrace;
  return session;
}

TEST(DialPlan, TheFormerHubComesFirstAndIsAloneForASecond) {
  DialPlan plan(options(true));
  plan.admitted(tcp(2).url());
  EXPECT_EQ(plan.all()[0].port, 2);
  EXPECT_FALSE(plan.broke("why", GoodbyeCode::done, {}, kBroke));
  EXPECT_EQ(plan.addresses(kBroke + DialPlan::kFormerHubNs - 1).size(), 1u);
  ASSERT_EQ(plan.addresses(kBroke + DialPlan::kFormerHubNs).size(), 3u);
  EXPECT_EQ(plan.addresses(kBroke + DialPlan::kFormerHubNs)[0].port, 2);
  EXPECT_EQ(plan.addresses(kBroke + DialPlan::kFormerHubNs)[1].port, 3);
}

TEST(DialPlan, AHubThatEndsIsNotWaitedFor) {
  DialPlan plan(options(true));
  EXPECT_FALSE(plan.broke("why", GoodbyeCode::draining, {}, kBroke));
  EXPECT_EQ(plan.addresses(kBroke).size(), 3u);
  plan.admitted(tcp(3).url());
  EXPECT_FALSE(plan.broke("why", GoodbyeCode::silent, {}, kBroke));
  EXPECT_EQ(plan.addresses(kBroke).size(), 1u) << "the next one did not say so";
}

TEST(DialPlan, ANodeThatWasToldToGoDoesNotDial) {
  for (const bool reconnect : {true, false}) {
    DialPlan plan(options(reconnect, true));
    EXPECT_EQ(plan.broke("why", GoodbyeCode::replaced, {}, kBroke)->status, NIF_REPLACED);
    EXPECT_EQ(plan.broke("why", GoodbyeCode::kicked, {}, kBroke)->status, NIF_REFUSED);
    EXPECT_FALSE(plan.broke("why", GoodbyeCode::renumbered, {}, kBroke));
  }
}

TEST(DialPlan, WithoutReconnectItDialsOnlyToResume) {
  DialPlan plan(options(false, true));
  EXPECT_EQ(plan.broke("why", GoodbyeCode::done, {}, kBroke)->status, NIF_NOT_CONNECTED);
  EXPECT_FALSE(plan.broke("why", GoodbyeCode::done, kept_session(), kBroke));
  EXPECT_TRUE(plan.resumes_only());
  EXPECT_EQ(plan.addresses(kBroke + 2 * DialPlan::kFormerHubNs).size(), 1u) << "where it is kept";
  EXPECT_EQ(plan.deadline(kBroke), kBroke + kGrace);
  EXPECT_TRUE(plan.dials_again({NIF_NO_HUB, ""}, kBroke + kGrace - 1));
  EXPECT_FALSE(plan.dials_again({NIF_NO_HUB, ""}, kBroke + kGrace));
  EXPECT_FALSE(plan.dials_again({NIF_NO_HUB, "", true}, kBroke)) << "its process is gone";
  EXPECT_EQ(plan.broke("why", GoodbyeCode::draining, kept_session(), kBroke)->status,
            NIF_NOT_CONNECTED);
}

TEST(DialPlan, AFailedDialIsRepeatedUnlessTheNodeWasReplaced) {
  DialPlan plan(options(true));
  EXPECT_FALSE(plan.broke("why", GoodbyeCode::done, kept_session(), kBroke));
  EXPECT_FALSE(plan.resumes_only());
  EXPECT_EQ(plan.deadline(kBroke), kBroke + DialPlan::kTryNs);
  EXPECT_TRUE(plan.dials_again({NIF_NO_HUB, "", true}, kBroke + 10 * kGrace));
  EXPECT_FALSE(plan.dials_again({NIF_REPLACED, ""}, kBroke));
  DialPlan once(options(false));
  EXPECT_FALSE(once.broke("why", GoodbyeCode::renumbered, {}, kBroke));
  EXPECT_FALSE(once.dials_again({NIF_NO_HUB, ""}, kBroke)) << "one try";
}

}  // namespace
}  // namespace gimnet::nif
