#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <string>
#include <thread>

#include "proto/control/ns_register.hpp"
#include "tests/client/nif/support/fake_hub.hpp"
#include "tests/client/nif/support/runtime_folder.hpp"

// A node's session token over the end of its program.

namespace gimnet::nif::test {
namespace {

nif_options keeping(const char* name) {
  nif_options options = default_options(name);
  options.no_token_file = 0;
  return options;
}

bool has_files(const RuntimeFolder& runtime) {
  return std::filesystem::exists(runtime.tokens()) && !std::filesystem::is_empty(runtime.tokens());
}

/// A program that joins, and then is killed.
void join_and_die(FakeHub& hub, const char* name) {
  const std::string url = hub.url();
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    nif_options options = keeping(name);
    options.url = url.c_str();
    nif_node* node = nullptr;
    if (nif_connect(&options, &node) != NIF_OK) ::_exit(1);
    ::kill(::getpid(), SIGKILL);
  }
  FakeConnection connection = hub.admit(make_welcome());
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
}

TEST(NodeToken, AProgramThatWasKilledShowsItsTokenAgain) {
  const RuntimeFolder runtime;
  FakeHub hub;
  join_and_die(hub, "robot");
  const Connected again = connect_to(hub, keeping("robot"), make_welcome());
  EXPECT_EQ(again.hello.token, make_welcome().token);
  EXPECT_EQ(info_of(again.node.get()).token_kept, 1);
}

TEST(NodeToken, AnotherNameShowsNone) {
  const RuntimeFolder runtime;
  FakeHub hub;
  join_and_die(hub, "robot");
  EXPECT_TRUE(connect_to(hub, keeping("lifter"), make_welcome()).hello.token.empty());
  EXPECT_TRUE(connect_to(hub, keeping(nullptr), make_welcome()).hello.token.empty());
}

TEST(NodeToken, ASecondProgramBesideItShowsNone) {
  const RuntimeFolder runtime;
  FakeHub hub;
  const Connected first = connect_to(hub, keeping("robot"), make_welcome());
  const Connected second = connect_to(hub, keeping("robot"), make_welcome());
  EXPECT_TRUE(second.hello.token.empty());
  EXPECT_EQ(info_of(second.node.get()).token_kept, 0);
  char sentence[200];
  nif_last_error(second.node.get(), sentence, sizeof sentence);
  EXPECT_NE(std::string(sentence).find("another node of that name"), std::string::npos) << sentence;
}

TEST(NodeToken, GoodbyeRemovesIt) {
  const RuntimeFolder runtime;
  FakeHub hub;
  Connected connected = connect_to(hub, keeping("robot"), make_welcome());
  EXPECT_TRUE(has_files(runtime));
  std::thread reading([&connected] {
    EXPECT_TRUE(connected.hub.next_message()) << "GOODBYE";
    connected.hub.close();
  });
  EXPECT_EQ(nif_close(connected.node.release()), NIF_OK);
  reading.join();
  EXPECT_FALSE(has_files(runtime));
}

TEST(NodeToken, ItStaysWhereGoodbyeCouldNotBeSaid) {
  const RuntimeFolder runtime;
  FakeHub hub;
  {
    FakeConnection again{-1};  // outlives the node, which would dial once more
    Connected connected = connect_to(hub, keeping("robot"), make_welcome());
    connected.hub.close();
    nif_incoming in{};
    ASSERT_EQ(nif_receive(connected.node.get(), &in, 20'000), NIF_OK);
    EXPECT_EQ(in.type, static_cast<std::uint32_t>(NIF_DISCONNECTED));
    nif_release(&in);
    again = hub.accept();  // nobody welcomes it
  }
  EXPECT_TRUE(has_files(runtime));
  EXPECT_EQ(connect_to(hub, keeping("robot"), make_welcome()).hello.token, make_welcome().token);
}

TEST(NodeToken, AReplacedNodeLetsItGoAndStaysAway) {
  const RuntimeFolder runtime;
  FakeHub hub;
  Connected first = connect_to(hub, keeping("robot"), make_welcome());
  first.hub.goodbye(proto::GoodbyeCode::replaced, "a newer connection has the session");
  nif_incoming in{};
  ASSERT_EQ(nif_receive(first.node.get(), &in, 20'000), NIF_OK);
  EXPECT_EQ(in.type, static_cast<std::uint32_t>(NIF_SESSION_REPLACED));
  nif_release(&in);
  EXPECT_EQ(nif_receive(first.node.get(), &in, 20'000), NIF_REPLACED);
  EXPECT_EQ(info_of(first.node.get()).token_kept, 0);
  // The next connection of the hub is this one: the replaced node has not dialed again.
  EXPECT_EQ(connect_to(hub, keeping("robot"), make_welcome()).hello.token, make_welcome().token);
}

/// Has the node ask for a name, and gives it.
void rename(Connected& connected, const char* name, const std::vector<std::byte>& token) {
  std::thread asking(
      [&] { EXPECT_EQ(nif_register(connected.node.get(), name, NIF_FOREVER), NIF_OK); });
  std::uint16_t number = 0;
  EXPECT_TRUE(connected.hub.next_request<proto::ns::RegisterName>(number));
  connected.hub.send_control(
      proto::Kind::ns, proto::encode_answer(proto::ns::RegisterNameAnswer{name, token}, number));
  asking.join();
  while (info_of(connected.node.get()).token_kept == 0) std::this_thread::yield();
}

TEST(NodeToken, FollowsTheNodeToItsNewName) {
  const RuntimeFolder runtime;
  FakeHub hub;
  const std::vector<std::byte> token(20, std::byte{7});
  {
    Connected connected = connect_to(hub, keeping("robot"), make_welcome());
    rename(connected, "forklift", token);
    connected.hub.close();  // GOODBYE cannot be said: as if the program was killed
    nif_incoming in{};
    ASSERT_EQ(nif_receive(connected.node.get(), &in, 20'000), NIF_OK);
    EXPECT_EQ(in.type, static_cast<std::uint32_t>(NIF_DISCONNECTED));
    nif_release(&in);
  }
  EXPECT_TRUE(connect_to(hub, keeping("robot"), make_welcome()).hello.token.empty());
  EXPECT_EQ(connect_to(hub, keeping("forklift"), make_welcome()).hello.token, token);
}

TEST(NodeToken, ANodeThatTakesItsFirstNameLaterKeepsItsTokenFromThenOn) {
  const RuntimeFolder runtime;
  FakeHub hub;
  Connected connected = connect_to(hub, keeping(nullptr), make_welcome());
  EXPECT_FALSE(has_files(runtime));
  rename(connected, "robot", std::vector<std::byte>(20, std::byte{8}));
  EXPECT_TRUE(has_files(runtime));
  std::thread asking([&] { EXPECT_EQ(nif_unregister(connected.node.get(), NIF_FOREVER), NIF_OK); });
  std::uint16_t number = 0;
  EXPECT_TRUE(connected.hub.next_request<proto::ns::UnregisterName>(number));
  connected.hub.send_control(
      proto::Kind::ns,
      proto::encode_answer(proto::ns::UnregisterNameAnswer{{std::byte{9}}}, number));
  asking.join();
  while (has_files(runtime)) std::this_thread::yield();
  EXPECT_EQ(info_of(connected.node.get()).token_kept, 0);
}

TEST(NodeToken, CanBeSwitchedOff) {
  const RuntimeFolder runtime;
  FakeHub hub;
  nif_options options = keeping("robot");
  options.no_token_file = 1;
  const Connected connected = connect_to(hub, options, make_welcome());
  EXPECT_EQ(info_of(connected.node.get()).token_kept, 0);
  EXPECT_FALSE(std::filesystem::exists(runtime.path() + "/gimnet"));
}

TEST(NodeToken, AFolderThatCannotBeUsedCostsNothingElse) {
  const Environment nowhere("XDG_RUNTIME_DIR", "/nonexistent/gimnet");
  FakeHub hub;
  const Connected connected = connect_to(hub, keeping("robot"), make_welcome());
  EXPECT_EQ(info_of(connected.node.get()).token_kept, 0);
  char sentence[200];
  nif_last_error(connected.node.get(), sentence, sizeof sentence);
  EXPECT_NE(std::string(sentence).find("/nonexistent/gimnet"), std::string::npos) << sentence;
}

}  // namespace
}  // namespace gimnet::nif::test
