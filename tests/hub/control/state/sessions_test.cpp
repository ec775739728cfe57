#include "hub/control/state/sessions.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

class SessionsTest : public ::testing::Test {
 protected:
  SessionsTest() {
    limits_.nodes = 3;
    limits_.grace_ms = 30'000;
  }
  Session& create(std::chrono::milliseconds now = 0ms) {
    const auto created = sessions_.create(std::nullopt, now);
    EXPECT_TRUE(created);
    (*created)->identity = Identity::open();
    sessions_.renew_token(**created, 0ms);
    sessions_.attach(**created, now);
    return **created;
  }

  Session* claim(std::span<const std::byte> token, Identity identity = Identity::open(),
                 std::chrono::milliseconds wall = 0ms) {
    return sessions_.claim({token, "", identity, wall}).session;
  }

  Limits limits_;
  Sessions sessions_{Sessions::Options{HubId{7}, 2, Placement::spread}, limits_};
};

TEST_F(SessionsTest, NewOnesGetIdsAndAlternatingShards) {
  const Session& a = create();
  const Session& b = create();
  EXPECT_EQ(a.index, NodeIndex{1});
  EXPECT_EQ(b.index, NodeIndex{2});
  EXPECT_EQ(sessions_.node_id(a), make_id<NodeId>(HubId{7}, 1));
  EXPECT_NE(a.place.shard, b.place.shard);
  EXPECT_NE(a.place.generation, b.place.generation);
  EXPECT_EQ(sessions_.connected(), 2u);
}

TEST_F(SessionsTest, TakesAsManyAsTheLimitAndNotOneMore) {
  create();
  create();
  Session& last = create();
  const auto refused = sessions_.create(std::nullopt, 0ms);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, proto::GoodbyeCode::hub_full);
  EXPECT_EQ(refused.error().sentence,
            "this hub has as many nodes as it takes (3); connect to another one, or start it with "
            "a larger --limit nodes");
  sessions_.end(last, 0ms);
  EXPECT_TRUE(sessions_.create(std::nullopt, 0ms));
}

TEST_F(SessionsTest, AnAdministratorIsToldOfTheLimitThatIsHis) {
  limits_.administrators = 1;
  for (int i = 0; i < 3; ++i) create();
  EXPECT_TRUE(sessions_.create(std::nullopt, 0ms, Places::all));
  const auto refused = sessions_.create(std::nullopt, 0ms, Places::all);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().sentence,
              HasSubstr("(4); connect to another one, or start it with a larger --limit admin"));
}

TEST_F(SessionsTest, ATokenClaimsItsOwnSessionOnly) {
  Session& a = create();
  Session& b = create();
  EXPECT_EQ(claim(sessions_.token_of(a)), &a);
  EXPECT_EQ(claim(sessions_.token_of(b)), &b);
  EXPECT_LE(sessions_.token_of(a).size(), proto::kTokenBytesMax);
}

TEST_F(SessionsTest, AForgedTokenClaimsNothing) {
  Session& session = create();
  const std::vector<std::byte> token = sessions_.token_of(session);
  for (std::size_t i = 0; i < token.size(); ++i) {
    std::vector<std::byte> forged = token;
    forged[i] ^= std::byte{1};
    EXPECT_EQ(claim(forged), nullptr) << "byte " << i;
  }
  EXPECT_EQ(claim({}), nullptr);
  EXPECT_EQ(claim(std::span{token}.first(token.size() - 1)), nullptr);
  std::vector<std::byte> longer = token;
  longer.push_back(std::byte{0});
  EXPECT_EQ(claim(longer), nullptr);
}

// A node that cannot prove a token learns nothing by showing it: not whether it has expired, nor
// whether its session lives.
TEST_F(SessionsTest, WhateverIsWrongWithATokenTheAnswerIsTheSame) {
  Session& live = create();
  Session& gone = create();
  const std::chrono::milliseconds expired{limits_.token_ms};
  std::vector<std::vector<std::byte>> wrong{{}, std::vector<std::byte>(1 << 20, std::byte{7})};
  for (const Session* session : {&live, &gone}) {
    const std::vector<std::byte> token = sessions_.token_of(*session);
    wrong.emplace_back(token.begin(), token.end() - 1);
    wrong.push_back(token);
    wrong.back().push_back(std::byte{0});
    wrong.push_back(token);
    wrong.back().back() ^= std::byte{1};
    wrong.push_back(token);
    wrong.back()[4] ^= std::byte{1};  // of another index
  }
  const std::vector<std::byte> right = sessions_.token_of(gone);
  sessions_.end(gone, 0ms);
  ASSERT_TRUE(sessions_.claim({right, "", Identity::open(), 0ms}).token);
  const auto is_nothing = [](const Sessions::Claim& claim) {
    return claim.session == nullptr && !claim.token;
  };
  for (const std::vector<std::byte>& token : wrong) {
    for (const std::chrono::milliseconds wall : {0ms, expired}) {
      EXPECT_TRUE(is_nothing(sessions_.claim({token, "", Identity::open(), wall}))) << token.size();
    }
  }
  EXPECT_TRUE(is_nothing(sessions_.claim({right, "", Identity::open(), expired})));
  EXPECT_TRUE(is_nothing(sessions_.claim({right, "", Identity::of_user(1000), 0ms})));
  EXPECT_TRUE(is_nothing(sessions_.claim({right, "another name", Identity::open(), 0ms})));
}

TEST_F(SessionsTest, AnotherIdentityClaimsNothing) {
  Session& session = create();
  EXPECT_EQ(claim(sessions_.token_of(session), Identity::of_user(1000)), nullptr);
  EXPECT_EQ(claim(sessions_.token_of(session), Identity{}), nullptr);
}

TEST_F(SessionsTest, ATokenIsGoodUntilItsTimeExactly) {
  Session& session = create();
  const std::vector<std::byte> token = sessions_.token_of(session);
  const std::chrono::milliseconds lifetime{limits_.token_ms};
  EXPECT_EQ(claim(token, Identity::open(), lifetime - 1ms), &session);
  EXPECT_EQ(claim(token, Identity::open(), lifetime), nullptr);
}

TEST_F(SessionsTest, ATokenOutlivesARenamingAndIsForTheNewNameOnceRenewed) {
  Session& session = create();
  const std::vector<std::byte> token = sessions_.token_of(session);
  session.name = "robot";
  EXPECT_EQ(claim(token), &session);
  sessions_.renew_token(session, 0ms);
  EXPECT_NE(sessions_.token_of(session), token);
  EXPECT_EQ(claim(sessions_.token_of(session)), &session);
}

TEST_F(SessionsTest, AnEndedSessionsTokenBringsItBackUntilItIsSpent) {
  Session& session = create();
  const std::vector<std::byte> token = sessions_.token_of(session);
  const NodeIndex index = session.index;
  sessions_.end(session, 0ms);
  const auto claim_again = sessions_.claim({token, "", Identity::open(), 0ms});
  EXPECT_EQ(claim_again.session, nullptr);
  ASSERT_TRUE(claim_again.token);
  const auto restored = sessions_.restore(*claim_again.token, std::nullopt, 0ms);
  ASSERT_TRUE(restored);
  EXPECT_EQ((*restored)->index, index);
  EXPECT_EQ((*restored)->number, claim_again.token->number);
  sessions_.spend_token(**restored);
  sessions_.end(**restored, 0ms);
  EXPECT_FALSE(sessions_.claim({token, "", Identity::open(), 0ms}).token);
}

TEST_F(SessionsTest, RemembersAsManyKickedOnesAsTheLimitAllows) {
  limits_.kicked_tokens = 2;
  std::vector<NodeIndex> kicked;
  for (int i = 0; i < 3; ++i) {
    Session& session = create();
    kicked.push_back(session.index);
    EXPECT_TRUE(sessions_.remember_kicked(session));
    sessions_.end(session, 0ms);
  }
  ASSERT_EQ(sessions_.kicked().size(), 2u);
  EXPECT_EQ(sessions_.kicked()[0].index, kicked[1]);
  EXPECT_EQ(sessions_.kicked()[1].index, kicked[2]);
}

TEST_F(SessionsTest, SaysWhereNotAllTokensOfAKickedOneHaveRoom) {
  Session& session = create();
  sessions_.renew_token(session, 0ms);
  const NodeIndex given{session.index.value() + 50};
  ASSERT_TRUE(sessions_.indices().take_free(given.value(), 0ms));
  sessions_.renumber(session, given, 0ms);
  limits_.kicked_tokens = 0;
  EXPECT_FALSE(sessions_.remember_kicked(session));
  limits_.kicked_tokens = 1;
  EXPECT_FALSE(sessions_.remember_kicked(session));
  ASSERT_EQ(sessions_.kicked().size(), 1u);
  EXPECT_EQ(sessions_.kicked()[0].index, given) << "the one that it comes with";
  limits_.kicked_tokens = 2;
  EXPECT_TRUE(sessions_.remember_kicked(session));
}

TEST_F(SessionsTest, AFormerIdsTokenIsGoodAsLongAsTheSession) {
  Session& session = create();
  sessions_.renew_token(session, 0ms);
  const std::vector<std::byte> former = sessions_.token_of(session);
  const NodeIndex former_index = session.index;
  ASSERT_TRUE(sessions_.indices().take_free(70, 0ms));
  sessions_.renumber(session, NodeIndex{70}, 0ms);
  const std::vector<std::byte> latest = sessions_.token_of(session);
  EXPECT_EQ(claim(former), &session) << "it may not know of the other id yet";
  EXPECT_EQ(claim(latest), &session);
  sessions_.end(session, 0ms);
  for (const std::chrono::milliseconds later : {0ms, 1'000'000ms}) {
    const auto forgotten = sessions_.claim({former, "", Identity::open(), later});
    EXPECT_EQ(forgotten.session, nullptr);
    EXPECT_FALSE(forgotten.token) << "the node would have two ids: " << former_index.value()
                                  << " and 70";
    EXPECT_TRUE(sessions_.claim({latest, "", Identity::open(), later}).token);
  }
}

TEST_F(SessionsTest, ASpentTokenClaimsNothing) {
  Session& session = create();
  const std::vector<std::byte> token = sessions_.token_of(session);
  sessions_.spend_token(session);
  sessions_.end(session, 0ms);
  EXPECT_EQ(claim(token), nullptr);
  EXPECT_EQ(sessions_.find(NodeIndex{1}), nullptr);
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
  const auto first = sessions.create(std::nullopt, 0ms);
  ASSERT_TRUE(first);
  const Place place = (*first)->place;
  sessions.end(**first, 0ms);
  const auto second = sessions.create(std::nullopt, 1ms);
  ASSERT_TRUE(second);
  EXPECT_EQ((*second)->index, NodeIndex{2});
  EXPECT_EQ((*second)->place.slot,
            place.slot);  // slots are free at once, told apart by their generation
  EXPECT_NE((*second)->place.generation, place.generation);
}

TEST_F(SessionsTest, AHintIsHonouredOnlyWherePlacementSaysSo) {
  Sessions hinted{Sessions::Options{HubId{7}, 2, Placement::hint}, limits_};
  for (int i = 0; i < 2; ++i) {
    const auto session = hinted.create(std::uint16_t{1}, 0ms);
    ASSERT_TRUE(session);
    EXPECT_EQ((*session)->place.shard, ShardIndex{1});
  }
  const auto beyond = hinted.create(std::uint16_t{2}, 0ms);
  ASSERT_TRUE(beyond);
  EXPECT_EQ((*beyond)->place.shard, ShardIndex{0});
  const auto spread = sessions_.create(std::uint16_t{1}, 0ms);
  ASSERT_TRUE(spread);
  EXPECT_EQ((*spread)->place.shard, ShardIndex{0});
}

}  // namespace
}  // namespace gimnet::hub
