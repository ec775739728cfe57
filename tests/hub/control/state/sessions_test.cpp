#include "hub/control/state/sessions.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

Secret secret_of(int value) {
  Secret secret{};
  secret.fill(static_cast<std::byte>(value));
  return secret;
}

class SessionsTest : public ::testing::Test {
 protected:
  SessionsTest() {
    limits_.nodes = 3;
    limits_.grace_ms = 30'000;
  }
  Session& create(std::chrono::milliseconds now = 0ms) {
    const auto created = sessions_.create(secret_of(++secrets_), std::nullopt, now);
    EXPECT_TRUE(created);
    sessions_.attach(**created, now);
    return **created;
  }

  Limits limits_;
  Sessions sessions_{Sessions::Options{HubId{7}, 2, Placement::spread}, limits_};
  int secrets_ = 0;
};

TEST_F(SessionsTest, NewOnesGetIdsAndAlternatingShards) {
  const Session& a = create();
  const Session& b = create();
  EXPECT_EQ(a.index, 1u);
  EXPECT_EQ(b.index, 2u);
  EXPECT_EQ(sessions_.node_id(a), make_id<NodeId>(HubId{7}, 1));
  EXPECT_NE(a.place.shard, b.place.shard);
  EXPECT_NE(a.place.generation, b.place.generation);
  EXPECT_EQ(sessions_.connected(), 2u);
}

TEST_F(SessionsTest, TakesAsManyAsTheLimitAndNotOneMore) {
  create();
  create();
  Session& last = create();
  const auto refused = sessions_.create(secret_of(9), std::nullopt, 0ms);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, proto::GoodbyeCode::hub_full);
  EXPECT_THAT(refused.error().sentence, HasSubstr("takes 3 nodes"));
  sessions_.end(last, 0ms);
  EXPECT_TRUE(sessions_.create(secret_of(9), std::nullopt, 0ms));
}

TEST_F(SessionsTest, ATokenClaimsItsOwnSessionOnly) {
  Session& a = create();
  Session& b = create();
  EXPECT_EQ(sessions_.claim(Sessions::token_of(a)), &a);
  EXPECT_EQ(sessions_.claim(Sessions::token_of(b)), &b);
  EXPECT_LE(Sessions::token_of(a).size(), proto::kTokenBytesMax);
}

TEST_F(SessionsTest, AForgedTokenClaimsNothing) {
  Session& session = create();
  const std::vector<std::byte> token = Sessions::token_of(session);
  for (std::size_t i = 0; i < token.size(); ++i) {
    std::vector<std::byte> forged = token;
    forged[i] ^= std::byte{1};
    EXPECT_EQ(sessions_.claim(forged), nullptr) << "byte " << i;
  }
  EXPECT_EQ(sessions_.claim({}), nullptr);
  EXPECT_EQ(sessions_.claim(std::span{token}.first(token.size() - 1)), nullptr);
  std::vector<std::byte> longer = token;
  longer.push_back(std::byte{0});
  EXPECT_EQ(sessions_.claim(longer), nullptr);
}

TEST_F(SessionsTest, AnEndedSessionsTokenClaimsNothing) {
  Session& session = create();
  const std::vector<std::byte> token = Sessions::token_of(session);
  sessions_.end(session, 0ms);
  EXPECT_EQ(sessions_.claim(token), nullptr);
  EXPECT_EQ(sessions_.find(1), nullptr);
  EXPECT_EQ(sessions_.connected(), 0u);
}

TEST_F(SessionsTest, GraceEndsExactlyAtItsTime) {
  Session& session = create();
  sessions_.begin_grace(session, 1s);
  EXPECT_EQ(sessions_.next_expiry(), 31s);
  EXPECT_EQ(sessions_.next_expired(31s - 1ms), nullptr);
  EXPECT_EQ(sessions_.next_expired(31s), &session);
}

TEST_F(SessionsTest, WhoCameBackDoesNotExpire) {
  Session& session = create();
  sessions_.begin_grace(session, 1s);
  sessions_.attach(session, 5s);
  EXPECT_EQ(session.attachment, 2u);
  EXPECT_EQ(sessions_.next_expired(100s), nullptr);
  EXPECT_EQ(sessions_.next_expiry(), std::nullopt);
}

TEST_F(SessionsTest, ASecondAbsenceHasItsOwnGraceTime) {
  Session& session = create();
  sessions_.begin_grace(session, 1s);
  sessions_.attach(session, 5s);
  sessions_.begin_grace(session, 20s);
  EXPECT_EQ(sessions_.next_expired(49s), nullptr);
  EXPECT_EQ(sessions_.next_expired(50s), &session);
}

TEST_F(SessionsTest, AnIndexRestsForGraceAndTheLongestWait) {
  limits_.block_ms = 5'000;
  limits_.slow_consumer_ms = 10'000;
  Sessions sessions{Sessions::Options{HubId{7}, 1, Placement::spread}, limits_};
  const auto first = sessions.create(secret_of(1), std::nullopt, 0ms);
  ASSERT_TRUE(first);
  const Place place = (*first)->place;
  sessions.end(**first, 0ms);
  const auto second = sessions.create(secret_of(2), std::nullopt, 1ms);
  ASSERT_TRUE(second);
  EXPECT_EQ((*second)->index, 2u);
  EXPECT_EQ((*second)->place.slot, place.slot);  // slots are free at once, told apart by their generation
  EXPECT_NE((*second)->place.generation, place.generation);
}

TEST_F(SessionsTest, AHintIsHonouredOnlyWherePlacementSaysSo) {
  Sessions hinted{Sessions::Options{HubId{7}, 2, Placement::hint}, limits_};
  for (int i = 0; i < 2; ++i) {
    const auto session = hinted.create(secret_of(i), std::uint16_t{1}, 0ms);
    ASSERT_TRUE(session);
    EXPECT_EQ((*session)->place.shard, ShardIndex{1});
  }
  const auto beyond = hinted.create(secret_of(3), std::uint16_t{2}, 0ms);
  ASSERT_TRUE(beyond);
  EXPECT_EQ((*beyond)->place.shard, ShardIndex{0});
  const auto spread = sessions_.create(secret_of(4), std::uint16_t{1}, 0ms);
  ASSERT_TRUE(spread);
  EXPECT_EQ((*spread)->place.shard, ShardIndex{0});
}

}  // namespace
}  // namespace gimnet::hub
