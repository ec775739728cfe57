#include "gimnet/gimi/outcome.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "tests/client/gimi/support/without_exceptions.hpp"

namespace gimnet {
namespace {

/// Counts those that live.
class Counted {
 public:
  explicit Counted(int& living) : living_(&living) { ++*living_; }
  Counted(const Counted& other) : living_(other.living_) { ++*living_; }
  Counted& operator=(const Counted&) = delete;
  ~Counted() { --*living_; }

 private:
  int* living_;
};

TEST(Outcome, IsAValueOrAFailure) {
  const Outcome<int> value = 5;
  EXPECT_TRUE(value);
  EXPECT_EQ(*value, 5);
  EXPECT_FALSE(value.is(Status::closed)) << "as an empty failure would be";
  EXPECT_EQ(value.failure().sentence, "");
  const Outcome<int> failure = Failure{Status::timeout, "too late"};
  EXPECT_FALSE(failure);
  EXPECT_TRUE(failure.is(Status::timeout));
  EXPECT_EQ(failure.failure().sentence, "too late");
}

TEST(Outcome, EndsEachValueOnce) {
  int living = 0;
  {
    const Outcome<Counted> failure = Failure{Status::timeout, "none"};
    Outcome<Counted> first = Counted(living);
    const Outcome<Counted> second = first;
    EXPECT_EQ(living, 2);
    Outcome<Counted> third = std::move(first);
    third = failure;
    EXPECT_FALSE(third);
    third = second;
    EXPECT_TRUE(third);
    third = *&third;
    EXPECT_TRUE(third);
  }
  EXPECT_EQ(living, 0);
}

TEST(Outcome, TakesWhatCanOnlyBeMoved) {
  using Owner = std::unique_ptr<std::string>;
  static_assert(!std::is_copy_constructible_v<Outcome<Owner>>);
  static_assert(std::is_nothrow_move_constructible_v<Outcome<Owner>>);
  std::vector<Outcome<Owner>> outcomes;
  for (int i = 0; i < 10; ++i) outcomes.emplace_back(std::make_unique<std::string>("text"));
  outcomes.emplace_back(Failure{Status::closed, "closed"});
  outcomes.front() = std::move(outcomes.back());
  EXPECT_TRUE(outcomes.front().is(Status::closed));
  EXPECT_EQ(*std::move(outcomes[5]).or_throw(), "text");
}

// A plugin may be compiled without exceptions, and its program with them: each has its own answer.
TEST(OutcomeDeathTest, CodeWithExceptionsAndWithoutAreOneProgram) {
  Outcome<int> outcome = Failure{Status::timeout, "there is no value"};
  EXPECT_THROW(static_cast<void>(outcome.value()), GimnetError);
  EXPECT_EQ(test::value_without_exceptions(true), 5);
  EXPECT_DEATH(static_cast<void>(test::value_without_exceptions(false)), "there is no value");
}

}  // namespace
}  // namespace gimnet
