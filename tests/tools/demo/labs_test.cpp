#include "tools/demo/labs.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <optional>

#include "tools/demo/own_network.hpp"

namespace gimnet::demo {
namespace {

// The program, since its hubs and robots are processes that belong to it.
TEST(Labs, LoseOnlyWhatACutOfTheWanExplains) {
  const TemporaryFolder folder = std::move(TemporaryFolder::make().value());
  const std::string shown = folder / "shown";
  Result<ChildProcess> demo = ChildProcess::start(
      {"the demo",
       {"/bin/sh", "-c",
        folder_of_this_program() + "/gimnet-demo --labs --seconds 2 >" + shown + " 2>&1"},
       folder / "log"});
  ASSERT_TRUE(demo);
  const std::optional<int> status = demo->wait(120'000'000'000);
  std::ifstream file(shown);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  ASSERT_EQ(status, 0) << text;
  EXPECT_THAT(text, testing::HasSubstr(" for 2 viewers"));
  EXPECT_THAT(text, testing::HasSubstr("WAN: CUT\n"));
  EXPECT_THAT(text, testing::HasSubstr("WAN: back\n"));
  EXPECT_THAT(text, testing::HasSubstr("WAN: cut 1 time;"));
  EXPECT_THAT(text, testing::HasSubstr("As it should be: "));
}

}  // namespace
}  // namespace gimnet::demo
