#include "hub/control/state/due_list.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace gimnet::hub {
namespace {

using Notes = DueList<int>;

TEST(DueList, GivesBackInOrder) {
  Notes notes;
  EXPECT_TRUE(notes.empty());
  for (int i = 0; i < 3; ++i) notes.add(i, 3, [](int) { return false; });
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(notes.front(), i);
    notes.pop_front();
  }
  EXPECT_TRUE(notes.empty());
}

TEST(DueList, KeepsAsManyVoidNotesAsItMayAndForgetsThemWithOneMore) {
  constexpr int kValid = 10;
  constexpr int kMost = 2 * kValid + static_cast<int>(Notes::kVoidMost);
  Notes notes;
  const auto is_void = [](int note) { return note >= kValid; };
  for (int i = 0; i < kMost; ++i) notes.add(i, kValid, is_void);
  EXPECT_EQ(notes.size(), static_cast<std::size_t>(kMost));
  notes.add(kMost, kValid, is_void);
  EXPECT_EQ(std::vector<int>(notes.begin(), notes.end()),
            (std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9}));
}

TEST(DueList, PutsAllOffInTheirOrderAndNoneTooFar) {
  struct Due {
    int until;
  };
  DueList<Due> notes;
  for (const int until : {3, 5, 9}) notes.add({until}, 3, [](const Due&) { return false; });
  notes.put_off(4, 10);
  for (const int until : {7, 9, 10}) {
    EXPECT_EQ(notes.front().until, until);
    notes.pop_front();
  }
}

// A node that comes and goes a million times in no time.
TEST(DueList, StaysSmallHoweverManyBecomeVoid) {
  Notes notes;
  std::size_t looks = 0;
  for (int i = 0; i < 1'000'000; ++i) {
    notes.add(i, 1, [&looks, i](int note) {
      ++looks;
      return note != i;
    });
    ASSERT_LE(notes.size(), 2 + Notes::kVoidMost);
  }
  EXPECT_LT(looks, 2'000'000u) << "each note is looked at once or twice";
}

}  // namespace
}  // namespace gimnet::hub
