#include "client/gimi/failure.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>
#include <string_view>
#include <thread>

namespace gimnet {
namespace {

TEST(Outcome, HoldsAValue) {
  Outcome<int> outcome(3);
  EXPECT_TRUE(outcome);
  EXPECT_EQ(*outcome, 3);
  EXPECT_EQ(std::move(outcome).or_throw(), 3);
}

TEST(Outcome, HoldsAFailure) {
  const Outcome<int> outcome(Failure{Status::not_found, "no robot"});
  EXPECT_FALSE(outcome);
  EXPECT_TRUE(outcome.is(Status::not_found));
  EXPECT_EQ(outcome.failure().sentence, "no robot");
}

TEST(Outcome, ThrowsWhereAValueIsTakenThatIsNotThere) {
  Outcome<int> outcome(Failure{Status::timeout, "too late"});
  try {
    static_cast<void>(outcome.value());
    FAIL();
  } catch (const GimnetError& error) {
    EXPECT_EQ(error.status(), Status::timeout);
    EXPECT_STREQ(error.what(), "too late");
  }
  EXPECT_THROW(static_cast<void>(std::move(outcome).or_throw()), GimnetError);
}

TEST(Outcome, OfNothing) {
  const Outcome<void> done;
  EXPECT_TRUE(done);
  EXPECT_NO_THROW(done.or_throw());
  const Outcome<void> failed(Failure{Status::closed, "closed"});
  EXPECT_TRUE(failed.is(Status::closed));
  EXPECT_THROW(failed.or_throw(), GimnetError);
}

TEST(Outcome, EveryStatusHasItsOwnText) {
  std::set<std::string_view> texts;
  for (gimi_status status = GIMI_OK; status <= GIMI_SILENCE; ++status)
    texts.insert(gimi_status_text(status));
  for (const gimi_status status : {GIMI_NOT_TRUSTED, GIMI_NO_RIGHT, GIMI_EXPIRED})
    texts.insert(gimi_status_text(status));
  EXPECT_EQ(texts.size(), std::size_t{GIMI_SILENCE} + 1 + 3);
  EXPECT_FALSE(texts.contains("unknown status"));
  for (const gimi_status status : {GIMI_SILENCE + 1, GIMI_EXPIRED + 1, -1, INT32_MIN})
    EXPECT_STREQ(gimi_status_text(status), "unknown status");
}

TEST(Failure, ItsSentenceBelongsToTheThread) {
  EXPECT_EQ(gimi::fail(GIMI_LIMIT, "too many"), GIMI_LIMIT);
  std::thread([] {
    EXPECT_STREQ(gimi_error_text(), "");
    static_cast<void>(gimi::fail(GIMI_LIMIT, "another"));
  }).join();
  EXPECT_STREQ(gimi_error_text(), "too many");
}

TEST(Failure, ALongSentenceIsCut) {
  static_cast<void>(gimi::fail(GIMI_LIMIT, std::string(GIMI_ERROR_BYTES_MAX + 1, 'x')));
  EXPECT_EQ(std::string_view(gimi_error_text()).size(), std::size_t{GIMI_ERROR_BYTES_MAX});
}

}  // namespace
}  // namespace gimnet
