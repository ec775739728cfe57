#include "client/nif/token_store.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "tests/client/nif/support/runtime_folder.hpp"

namespace gimnet::nif::test {
namespace {

constexpr const char* kHub = "tcp://127.0.0.1:7450";
constexpr const char* kOtherHub = "unix:/run/hub";

std::vector<std::byte> token(int value) {
  return std::vector<std::byte>(56, static_cast<std::byte>(value));
}

std::size_t files_in(const std::string& path) {
  std::size_t files = 0;
  if (!std::filesystem::exists(path)) return 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(path)) ++files;
  return files;
}

TEST(TokenStore, TheNextLifeFindsTheLatestToken) {
  const RuntimeFolder runtime;
  {
    TokenStore store("robot", true);
    EXPECT_TRUE(store.find(kHub).empty());
    EXPECT_EQ(files_in(runtime.tokens()), 0u) << "looking makes nothing";
    store.keep(kHub, token(1));
    store.keep(kHub, token(2));
    EXPECT_TRUE(store.kept());
    EXPECT_EQ(store.fault(), "");
  }
  TokenStore again("robot", true);
  EXPECT_EQ(again.find(kHub), token(2));
  EXPECT_TRUE(again.find(kOtherHub).empty());
  EXPECT_TRUE(TokenStore("lifter", true).find(kHub).empty());
}

TEST(TokenStore, ASecondOneBesideItFindsNothingAndDisturbsNothing) {
  const RuntimeFolder runtime;
  TokenStore first("robot", true);
  first.keep(kHub, token(1));
  TokenStore second("robot", true);
  EXPECT_TRUE(second.find(kHub).empty());
  second.keep(kHub, token(9));
  EXPECT_FALSE(second.kept());
  EXPECT_NE(second.fault().find("another node of that name"), std::string::npos);
  second.forget();
  first.release();
  EXPECT_EQ(TokenStore("robot", true).find(kHub), token(1));
}

TEST(TokenStore, ForgettingLeavesNothing) {
  const RuntimeFolder runtime;
  TokenStore store("robot", true);
  store.keep(kHub, token(1));
  store.forget();
  EXPECT_FALSE(store.kept());
  EXPECT_EQ(files_in(runtime.tokens()), 0u);
}

TEST(TokenStore, AnotherHubsTokenTakesThePlaceOfTheFirst) {
  const RuntimeFolder runtime;
  TokenStore store("robot", true);
  store.keep(kHub, token(1));
  store.keep(kOtherHub, token(2));
  EXPECT_EQ(files_in(runtime.tokens()), 1u);
  store.release();
  EXPECT_EQ(TokenStore("robot", true).find(kOtherHub), token(2));
}

TEST(TokenStore, ANewNameHasAFileOfItsOwnAndTheFormerGoes) {
  const RuntimeFolder runtime;
  TokenStore store("robot", true);
  store.keep(kHub, token(1));
  store.rename("forklift");
  EXPECT_FALSE(store.kept());
  EXPECT_EQ(files_in(runtime.tokens()), 0u);
  store.keep(kHub, token(2));
  EXPECT_TRUE(store.kept());
  TokenStore rival("forklift", true);
  EXPECT_TRUE(rival.find(kHub).empty()) << "locked";
  TokenStore next("robot", true);
  next.keep(kHub, token(3));
  EXPECT_TRUE(next.kept()) << "the former name is free for another";
  store.rename("");
  store.keep(kHub, token(4));
  EXPECT_FALSE(store.kept());
  EXPECT_EQ(files_in(runtime.tokens()), 1u) << "the other one's";
  store.rename("lifter");
  store.keep(kHub, token(5));
  store.release();
  EXPECT_EQ(TokenStore("lifter", true).find(kHub), token(5));
}

TEST(TokenStore, NamelessNodesAndThoseThatDoNotWantItKeepNothing) {
  const RuntimeFolder runtime;
  for (const auto& [name, enabled] : {std::pair{"", true}, std::pair{"robot", false}}) {
    TokenStore store(name, enabled);
    store.keep(kHub, token(1));
    EXPECT_FALSE(store.kept());
    EXPECT_EQ(store.fault(), "");
    EXPECT_TRUE(store.find(kHub).empty());
  }
  EXPECT_FALSE(std::filesystem::exists(runtime.path() + "/gimnet"));
}

TEST(TokenStore, AFileWithSomethingElseInItIsNoToken) {
  const RuntimeFolder runtime;
  {
    TokenStore store("robot", true);
    store.keep(kHub, token(1));
  }
  const std::string path = runtime.tokens() + "/" + token_file_name(kHub, "robot");
  ASSERT_TRUE(std::filesystem::exists(path));
  std::ofstream(path, std::ios::binary) << "GIMtoken, or so it seems";
  EXPECT_TRUE(TokenStore("robot", true).find(kHub).empty());
  std::filesystem::resize_file(path, std::uintmax_t{1} << 30);
  TokenStore again("robot", true);
  EXPECT_TRUE(again.find(kHub).empty());
  again.keep(kHub, token(3));
  EXPECT_TRUE(again.kept());
  EXPECT_EQ(again.fault(), "the token file " + path +
                               " is not used, and the node may get a new id: what it holds is no "
                               "session token");
  again.keep(kHub, token(3));
  EXPECT_EQ(again.fault(), "") << "told once";
  EXPECT_LT(std::filesystem::file_size(path), 200u);
  // Another node's record, by whatever chance.
  again.release();
  const auto record = write_token_record({kHub, "lifter", token(4)});
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(record->data()),
             static_cast<std::streamsize>(record->size()));
  EXPECT_TRUE(TokenStore("robot", true).find(kHub).empty());
}

TEST(TokenStore, AFileThatCannotBeOpenedIsNamed) {
  const RuntimeFolder runtime;
  {
    TokenStore store("robot", true);
    store.keep(kHub, token(1));
  }
  const std::string path = runtime.tokens() + "/" + token_file_name(kHub, "robot");
  ASSERT_EQ(::chmod(path.c_str(), 0644), 0);
  TokenStore store("robot", true);
  EXPECT_TRUE(store.find(kHub).empty());
  store.keep(kHub, token(2));
  EXPECT_FALSE(store.kept());
  EXPECT_EQ(store.fault(), "the session token is not kept over a crash: " + path +
                               " is another user's, open to others, or no file; remove it");
}

TEST(TokenStore, AFolderThatOthersCanEnterIsNotUsedAndTold) {
  const RuntimeFolder runtime;
  ASSERT_EQ(::mkdir((runtime.path() + "/gimnet").c_str(), 0700), 0);
  ASSERT_EQ(::chmod((runtime.path() + "/gimnet").c_str(), 0755), 0);
  TokenStore store("robot", true);
  store.keep(kHub, token(1));
  EXPECT_FALSE(store.kept());
  EXPECT_NE(store.fault().find("chmod 700"), std::string::npos);
  ASSERT_EQ(::chmod((runtime.path() + "/gimnet").c_str(), 0700), 0);
  store.keep(kHub, token(1));
  EXPECT_TRUE(store.kept()) << "looks again each time";
}

}  // namespace
}  // namespace gimnet::nif::test
