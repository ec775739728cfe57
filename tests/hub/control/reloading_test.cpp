#include "hub/control/reloading.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

namespace gimnet::hub {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr std::string_view kHead = "nothing was changed, the former configuration stays in force";

/// Faults of ten bytes each, their line feeds included.
Reloading refused(std::size_t count) {
  Reloading reloading;
  for (std::size_t i = 0; i < count; ++i)
    reloading.faults.push_back("fault " + std::to_string(100 + i));
  return reloading;
}

TEST(Reloading, IsSummedUpInOneLine) {
  Reloading reloading;
  EXPECT_EQ(reload_summary(reloading), "configuration read again: nothing changed");
  reloading.changes = {{"log_level", "\"info\"", "\"debug\"", false}, {"shards", "1", "2", true}};
  EXPECT_EQ(reload_summary(reloading),
            "configuration read again: changed log_level from \"info\" to \"debug\"; needs a "
            "restart: shards from 1 to 2");
}

TEST(Reloading, EveryFaultThatHasRoomIsTold) {
  EXPECT_EQ(reload_refusal(refused(2), 1024), std::string(kHead) + "\nfault 100\nfault 101");
  const Reloading full = refused(20);
  const std::size_t bytes = kHead.size() + 20 * 10;
  EXPECT_EQ(reload_refusal(full, bytes).size(), bytes);
  EXPECT_THAT(reload_refusal(full, bytes), EndsWith("\nfault 119"));
}

TEST(Reloading, WhatHasNoRoomIsCountedAndNeverCut) {
  const Reloading full = refused(20);
  const std::size_t bytes = kHead.size() + 20 * 10;
  for (std::size_t most = 256; most < bytes; ++most) {
    const std::string said = reload_refusal(full, most);
    EXPECT_LE(said.size(), most);
    EXPECT_THAT(said, StartsWith(std::string(kHead) + "\nfault 100\n"));
    EXPECT_THAT(
        said,
        EndsWith(
            " more faults: the hub's log tells all of them, and so does tcphub --check-config"));
    const std::size_t told =
        static_cast<std::size_t>(std::count(said.begin(), said.end(), '\n')) - 1;
    EXPECT_THAT(said, HasSubstr("\nfault " + std::to_string(99 + told) + "\nand " +
                                std::to_string(20 - told) + " "));
    EXPECT_GT(said.size() + 10 + 1, most) << "one more has no room";
  }
}

TEST(Reloading, WhereThereAreOthersThatIsSaid) {
  Reloading reloading = refused(1);
  reloading.more_faults = true;
  EXPECT_EQ(reload_refusal(reloading, 1024),
            std::string(kHead) +
                "\nfault 100\nand at least 1 more fault: tcphub --check-config tells all of them");
}

TEST(Reloading, AFaultThatIsTooLongIsCounted) {
  Reloading reloading;
  reloading.faults = {std::string(5'000, 'x')};
  EXPECT_EQ(reload_refusal(reloading, 1024),
            std::string(kHead) +
                "\n1 fault: the hub's log tells all of them, and so does tcphub --check-config");
  reloading.faults.insert(reloading.faults.begin(), "short");
  EXPECT_THAT(reload_refusal(reloading, 1024),
              HasSubstr("\nshort\nand 1 more fault: the hub's log"));
  EXPECT_THAT(reload_refusal(reloading, 1024), Not(HasSubstr("xx")));
}

}  // namespace
}  // namespace gimnet::hub
