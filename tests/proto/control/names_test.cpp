#include "proto/control/names.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace gimnet::proto {
namespace {

std::string repeated(const std::string& part, std::size_t times) {
  std::string name = part;
  for (std::size_t i = 1; i < times; ++i) name += "/" + part;
  return name;
}

TEST(Names, AcceptPartsOfTheAllowedCharacters) {
  for (const char* name : {"a", "robot1/base", "A-Z_a-z.0-9", "...", "a/b/c"})
    EXPECT_TRUE(valid_name(name)) << name;
}

TEST(Names, RefuseEverythingElse) {
  for (const char* name : {"", "/", "a/", "/a", "a//b", "a b", "a*", "*", "**", "a\n", "\xC3\xA4",
                           "a\\b", "a:b", ".", "..", "a/../b", "./a", "a/."}) {
    EXPECT_FALSE(valid_name(name)) << name;
  }
  EXPECT_FALSE(valid_name(std::string("a\0b", 3)));
}

TEST(Names, HaveAtMost255Bytes) {
  EXPECT_TRUE(valid_name(std::string(255, 'a')));
  EXPECT_FALSE(valid_name(std::string(256, 'a')));
  EXPECT_STREQ(name_fault(std::string(256, 'a')), "it has more than 255 bytes");
}

TEST(Names, HaveAtMost16Parts) {
  EXPECT_TRUE(valid_name(repeated("a", 16)));
  EXPECT_FALSE(valid_name(repeated("a", 17)));
  EXPECT_STREQ(name_fault(repeated("a", 17)), "it has more than 16 parts");
}

TEST(Names, OfNodesDoNotReadAsIdsDo) {
  for (const char* name : {"7.17", "0.0", "007.1", "4095.1048575", "99999999999999999999.1"}) {
    EXPECT_STREQ(node_name_fault(name), "it reads as the id of a node does, NUMBER.NUMBER") << name;
    EXPECT_TRUE(valid_name(name)) << "as that of a service within its node, or a pattern: " << name;
  }
  for (const char* name :
       {"7", "7.", ".7", "7.17.1", "7.17/a", "a/7.17", "v7.17", "7.17a", "7-17", "7.-1"}) {
    EXPECT_STREQ(node_name_fault(name), nullptr) << name;
  }
  EXPECT_STREQ(node_name_fault("a b"), name_fault("a b"));
}

TEST(Names, OfServicesInFullHaveANodeAndNoWildcard) {
  EXPECT_STREQ(service_full_name_fault("robot/odom"), nullptr);
  EXPECT_STREQ(service_full_name_fault("hall/robot/odom"), nullptr);
  EXPECT_STREQ(service_full_name_fault("odom"),
               "it is no full name of a service: write NODE/SERVICE");
  EXPECT_STREQ(
      service_full_name_fault("1.3/odom"),
      "it begins with an id, and services are called by names: write NODE/SERVICE with the "
      "name of the node");
  EXPECT_STREQ(service_full_name_fault("1.3/arm/odom"), nullptr) << "a node may be named 1.3/arm";
  for (const char* pattern : {"*", "**", "robot/*", "*/odom"}) {
    EXPECT_THAT(service_full_name_fault(pattern), testing::StartsWith("it is a pattern"))
        << pattern;
  }
  for (const char* name : {"", "a b", "robot/", "a*/b"})
    EXPECT_STREQ(service_full_name_fault(name), name_fault(name)) << name;
}

TEST(Patterns, AreNamesWithWildcardParts) {
  for (const char* pattern : {"a", "*", "**", "a/*", "*/a/**", "**/**"})
    EXPECT_TRUE(valid_pattern(pattern)) << pattern;
  for (const char* pattern : {"", "a*", "***", "*/", "**a", "a//*"})
    EXPECT_FALSE(valid_pattern(pattern)) << pattern;
}

TEST(Patterns, MatchTheWholeName) {
  EXPECT_TRUE(matches("robot/base", "robot/base"));
  EXPECT_FALSE(matches("robot/base", "robot"));
  EXPECT_FALSE(matches("robot", "robot/base"));
  EXPECT_FALSE(matches("robot", "robot2"));
}

TEST(Patterns, StarIsOnePart) {
  EXPECT_TRUE(matches("*", "robot"));
  EXPECT_FALSE(matches("*", "robot/base"));
  EXPECT_TRUE(matches("robot/*/scan", "robot/laser/scan"));
  EXPECT_FALSE(matches("robot/*/scan", "robot/scan"));
}

TEST(Patterns, TwoStarsAreAnyNumberOfParts) {
  for (const char* name : {"a", "a/b", "a/b/c"}) EXPECT_TRUE(matches("**", name)) << name;
  EXPECT_TRUE(matches("a/**", "a"));
  EXPECT_TRUE(matches("a/**/z", "a/z"));
  EXPECT_TRUE(matches("a/**/z", "a/b/z/z"));
  EXPECT_FALSE(matches("a/**/z", "a/b/z/c"));
  EXPECT_TRUE(matches("**/b/**", "a/b"));
  EXPECT_FALSE(matches("**/b/**", "a/c"));
}

TEST(Patterns, DoNotMatchWhatIsNotValid) {
  EXPECT_FALSE(matches("**", ""));
  EXPECT_FALSE(matches("**", "a//b"));
  EXPECT_FALSE(matches("a*", "a*"));
}

TEST(Patterns, MatchTheLongestOfBoth) {
  EXPECT_TRUE(matches(repeated("**", 16), repeated("a", 16)));
  EXPECT_TRUE(matches(repeated("*", 16), repeated("a", 16)));
  EXPECT_FALSE(matches(repeated("**", 15) + "/b", repeated("a", 16)));
}

TEST(ServiceNames, StandBehindTheirNodes) {
  EXPECT_EQ(join_service_name("robot/base", "odom"), "robot/base/odom");
}

TEST(ServiceNames, HaveOnePart) {
  EXPECT_TRUE(valid_service_name("odom"));
  EXPECT_FALSE(valid_service_name("laser/scan"));
  EXPECT_FALSE(valid_service_name(""));
}

}  // namespace
}  // namespace gimnet::proto
