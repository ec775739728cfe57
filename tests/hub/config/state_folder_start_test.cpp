#include "hub/config/state_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>

#include "base/log.hpp"
#include "tests/hub/control/support/folder.hpp"

// From what a hub goes on when it starts.

namespace gimnet::hub {
namespace {

using ::testing::HasSubstr;

class StartStateTest : public ::testing::Test {
 protected:
  StartStateTest() {
    set_log_level(LogLevel::off);
    ::unsetenv("STATE_DIRECTORY");
    ::setenv("XDG_STATE_HOME", folder_.path("home").c_str(), 1);
  }
  ~StartStateTest() override {
    ::unsetenv("XDG_STATE_HOME");
    set_log_level(LogLevel::info);
  }
  static StateWish wish(const std::string& folder = "",
                        const std::string& address = "tcp://127.0.0.1:7450") {
    return {.folder = folder,
            .address = *parse_listen_url(address),
            .wall = std::chrono::milliseconds{1'000}};
  }

  TestFolder folder_;
};

TEST_F(StartStateTest, FoldersAreNamedAfterTheAddress) {
  EXPECT_EQ(state_folder_name(*parse_listen_url("tcp://127.0.0.1:7450")), "hub-tcp-127.0.0.1-7450");
  EXPECT_EQ(state_folder_name(*parse_listen_url("tcp://[::1]:1")), "hub-tcp-__1-1");
  EXPECT_EQ(state_folder_name(*parse_listen_url("unix:/run/hub+sock")), "hub-unix-run-hub_sock");
  EXPECT_EQ(state_folder_name(*parse_listen_url("tcp://127.0.0.1:0")), "");
}

TEST_F(StartStateTest, TheFirstStartBeginsAtOneAndIsKeptBeforeAnythingElse) {
  const auto first = start_state(wish(folder_.path("state")));
  ASSERT_TRUE(first);
  EXPECT_EQ(first->start.state.boot, 1u);
  EXPECT_EQ(first->start.nodes.first, 1u);
  EXPECT_EQ(**first->folder->read(), first->start.state);
}

TEST_F(StartStateTest, TheNextStartGoesOnAboveTheMark) {
  Secret secret{};
  {
    const auto first = start_state(wish(folder_.path("state")));
    ASSERT_TRUE(first);
    secret = first->start.state.secret;
  }
  const auto second = start_state(wish(folder_.path("state")));
  ASSERT_TRUE(second);
  EXPECT_EQ(second->start.state.boot, 2u);
  EXPECT_EQ(second->start.state.secret, secret);
  EXPECT_EQ(second->start.nodes.first, 1 + IndexPool::kBlock);
  EXPECT_EQ(second->start.groups.first, 1 + IndexPool::kBlock);
}

TEST_F(StartStateTest, SecretsAndIdsDiffer) {
  const auto a = start_state(wish(folder_.path("a")));
  const auto b = start_state(wish(folder_.path("b")));
  ASSERT_TRUE(a);
  ASSERT_TRUE(b);
  EXPECT_NE(a->start.state.secret, b->start.state.secret);
  EXPECT_NE(a->start.state.unique_id, b->start.state.unique_id);
  EXPECT_NE(a->instance, b->instance);
}

TEST_F(StartStateTest, AHubIdIsDrawnOnceAndKept) {
  std::set<std::uint64_t> instances;
  const auto start = [this, &instances](bool draws) {
    StateWish wished = wish(folder_.path("state"));
    wished.draws_hub = draws;
    const Result<StartState> found = start_state(wished);
    EXPECT_TRUE(instances.insert(found->instance.value()).second) << "at each start another";
    return found->start.state.drawn_hub;
  };
  EXPECT_EQ(start(false), HubId{0});
  const HubId drawn = start(true);
  EXPECT_GE(drawn.value(), kDrawnHubMin);
  EXPECT_EQ(start(true), drawn);
  EXPECT_EQ(start(false), drawn) << "its nodes have ids of that hub";
  StateWish redrawn = wish(folder_.path("state"));
  redrawn.drawn = HubId{2'000};
  EXPECT_EQ(start_state(redrawn)->start.state.drawn_hub, HubId{2'000});
  EXPECT_EQ(start(true), HubId{2'000}) << "kept in place of the former one";
}

TEST_F(StartStateTest, AHubWithoutAFolderDrawsAtEachStart) {
  StateWish wished = wish("", "tcp://127.0.0.1:0");
  EXPECT_EQ(start_state(wished)->start.state.drawn_hub, HubId{0});
  wished.draws_hub = true;
  std::set<HubId> drawn;
  for (int i = 0; i < 20; ++i) drawn.insert(start_state(wished)->start.state.drawn_hub);
  EXPECT_GT(drawn.size(), 10u);
}

TEST_F(StartStateTest, WithoutAWishTheStateIsInTheUsersFolder) {
  ASSERT_EQ(::mkdir(folder_.path("home").c_str(), 0700), 0);
  const auto start = start_state(wish());
  ASSERT_TRUE(start);
  ASSERT_NE(start->folder, nullptr);
  EXPECT_EQ(start->folder->path(), folder_.path("home/gimnet/hub-tcp-127.0.0.1-7450"));
}

TEST_F(StartStateTest, APortThatTheSystemChoosesKeepsNothing) {
  const auto start = start_state(wish("", "tcp://127.0.0.1:0"));
  ASSERT_TRUE(start);
  EXPECT_EQ(start->folder, nullptr);
  EXPECT_EQ(start->start.nodes.first, 1u);
  EXPECT_FALSE(std::filesystem::exists(folder_.path("home")));
}

TEST_F(StartStateTest, WhereNoFolderCanBeHadTheHubRunsWithoutOne) {
  std::ofstream(folder_.path("home")) << "in the way";
  const auto start = start_state(wish());
  ASSERT_TRUE(start);
  EXPECT_EQ(start->folder, nullptr);
  ::unsetenv("XDG_STATE_HOME");
  const std::string home = std::getenv("HOME") != nullptr ? std::getenv("HOME") : "";
  ::unsetenv("HOME");
  EXPECT_TRUE(start_state(wish()));
  if (!home.empty()) ::setenv("HOME", home.c_str(), 1);
}

TEST_F(StartStateTest, AFolderThatWasAskedForMustBeUsable) {
  std::ofstream(folder_.path("file")) << "x";
  const auto start = start_state(wish(folder_.path("file")));
  ASSERT_FALSE(start);
  EXPECT_THAT(start.error().sentence, HasSubstr(folder_.path("file")));
}

TEST_F(StartStateTest, DamagedStateKeepsTheHubFromStartingAnew) {
  ASSERT_EQ(::mkdir(folder_.path("home").c_str(), 0700), 0);
  std::string path;
  {
    const auto start = start_state(wish());
    ASSERT_TRUE(start);
    path = start->folder->path();
  }
  std::filesystem::resize_file(path + "/state", 10);
  const auto damaged = start_state(wish());
  ASSERT_FALSE(damaged);
  EXPECT_THAT(damaged.error().sentence, HasSubstr(path + "/state"));
  // Moved away, as the sentence says: the hub begins anew, but not where the old one began.
  std::filesystem::remove(path + "/state");
  const auto anew = start_state(wish());
  ASSERT_TRUE(anew);
  EXPECT_EQ(anew->start.state.boot, 1u);
  EXPECT_NE(anew->start.nodes.first, 1u) << "by chance once in a million";
}

// Blocks at fixed places would repeat all ids of the earlier hub now and then.
TEST_F(StartStateTest, IdsOfAHubWithoutItsFormerStateBeginAtAnyPlace) {
  std::ofstream(folder_.path("home")) << "in the way";
  std::set<std::uint32_t> places;
  for (int i = 0; i < 16; ++i) {
    const auto start = start_state(wish());
    ASSERT_TRUE(start);
    EXPECT_GE(start->start.nodes.first, 1u);
    EXPECT_LE(start->start.nodes.first, kIndexMost);
    places.insert(start->start.nodes.first % IndexPool::kBlock);
    places.insert(start->start.groups.first % IndexPool::kBlock);
  }
  EXPECT_GT(places.size(), 16u);
}

TEST_F(StartStateTest, AFolderInUseIsAnErrorEvenWhereItIsTheDefault) {
  ASSERT_EQ(::mkdir(folder_.path("home").c_str(), 0700), 0);
  const auto first = start_state(wish());
  ASSERT_TRUE(first);
  const auto second = start_state(wish());
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().sentence, HasSubstr("in use by"));
}

}  // namespace

}  // namespace gimnet::hub
