#include "gimnet/gimi/outcome.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>

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
  for (int status = 0; status <= static_cast<int>(Status::not_retained); ++status) {
    texts.insert(status_text(static_cast<Status>(status)));
  }
  EXPECT_EQ(texts.size(), static_cast<std::size_t>(Status::not_retained) + 1);
  EXPECT_FALSE(texts.contains("unknown status"));
}

}  // namespace
}  // namespace gimnet
