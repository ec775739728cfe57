#include "proto/frame/fragment_stream.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace gimnet::proto {
namespace {

std::size_t goes(const std::vector<Holding>& by_age) { return first_of_fullest_source(by_age); }

TEST(FullestSource, LosesItsFirstEntry) {
  EXPECT_EQ(goes({{.src = 1, .amount = 1}}), 0u);
  EXPECT_EQ(goes({{1, 1}, {2, 1}, {3, 1}, {2, 1}}), 1u);
  EXPECT_EQ(goes({{9, 1}, {3, 1}, {2, 2}, {3, 2}}), 1u) << "sums count, and not single entries";
  EXPECT_EQ(goes({{9, 5}, {3, 1}, {3, 1}, {3, 1}}), 0u);
}

TEST(FullestSource, OfSeveralIsTheOneThatCameFirst) {
  EXPECT_EQ(goes({{7, 1}, {2, 1}, {9, 1}}), 0u);
  EXPECT_EQ(goes({{1, 1}, {7, 1}, {2, 2}, {7, 1}}), 1u);
}

TEST(FullestSource, LosesNoEntryWithoutAnAmount) { EXPECT_EQ(goes({{1, 0}, {2, 0}, {1, 3}}), 2u); }

}  // namespace
}  // namespace gimnet::proto
