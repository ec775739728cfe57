#include "client/nif/session_terms.hpp"

#include <gtest/gtest.h>

#include <string>

#include "tests/client/nif/support/fake_hub.hpp"

namespace gimnet::nif::test {
namespace {

TEST(SessionTerms, RefusesImpossibleWelcomes) {
  EXPECT_TRUE(session_terms_of(make_welcome(), true, 0));
  const auto fault_with = [](auto change) {
    proto::Welcome welcome = make_welcome();
    change(welcome);
    const auto session = session_terms_of(welcome, true, 0);
    if (session) return std::string();
    EXPECT_EQ(session.error().status, NIF_PROTOCOL);
    return session.error().sentence;
  };
  EXPECT_NE(fault_with([](auto& w) { w.node = NodeId{0}; }), "");
  EXPECT_NE(fault_with([](auto& w) { w.node = NodeId{kHubNode}; }), "") << "the hub itself";
  EXPECT_NE(fault_with([](auto& w) { w.node = NodeId{0xFFFFFFFF}; }), "");
  EXPECT_NE(fault_with([](auto& w) { w.hub = HubId{8}; }), "") << "an id of another hub";
  EXPECT_EQ(fault_with([](auto& w) { w.token.clear(); }), "the hub's WELCOME has no token");
  EXPECT_NE(fault_with([](auto& w) { w.frame_length_max = 16 * 1024 - 1; }), "");
  EXPECT_EQ(fault_with([](auto& w) { w.frame_length_max = 16 * 1024; }), "");
}

TEST(SessionTerms, BoundsThatTheHubAsksFor) {
  proto::Welcome welcome = make_welcome();
  welcome.frame_length_max = 1u << 20;
  welcome.keep_alive_ms = 0;
  welcome.silent_ms = 0xFFFFFFFF;
  const auto session = session_terms_of(welcome, false, 0);
  ASSERT_TRUE(session);
  EXPECT_EQ(session->id, kOwnId);
  EXPECT_EQ(session->name, "robot");
  EXPECT_EQ(session->frame_bytes_max, 65'536u);
  EXPECT_EQ(session->keep_alive_ns, 1'000 * kNsPerMs);
  EXPECT_LE(session->silent_after_ns, 120'000 * kNsPerMs);
}

TEST(SessionTerms, ResumesOnlyAsHelloAskedForIt) {
  proto::Welcome welcome = make_welcome(1000);
  welcome.resumed = true;
  welcome.taken = 5;
  const auto resumed = session_terms_of(welcome, true, welcome.epoch);
  ASSERT_TRUE(resumed);
  EXPECT_TRUE(resumed->resumed);
  EXPECT_EQ(resumed->hub_taken, 5u);
  const auto fresh = session_terms_of(welcome, true, 0);
  ASSERT_TRUE(fresh);
  EXPECT_TRUE(fresh->resume);
  EXPECT_FALSE(fresh->resumed);
  EXPECT_FALSE(session_terms_of(welcome, true, welcome.epoch + 1));
  EXPECT_FALSE(session_terms_of(welcome, false, welcome.epoch)->resume);
}

}  // namespace
}  // namespace gimnet::nif::test
