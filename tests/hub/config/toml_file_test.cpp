#include "hub/config/toml_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::StartsWith;

std::vector<std::string> places(const TomlFile& file) {
  std::vector<std::string> found;
  for (const ConfigFault& fault : file.faults) found.push_back(fault.place);
  return found;
}

std::vector<std::string> keys(const TomlFile& file) {
  std::vector<std::string> found;
  for (const Given& given : file.keys) found.push_back(given.key);
  return found;
}

TEST(TomlFile, KnowsWhereEveryKeyAndValueStands) {
  const TomlFile file = read_toml("# a hub\nshards = 2\n\n[limits]\n  nodes   = 10\n", "hub.toml");
  EXPECT_THAT(file.faults, IsEmpty());
  ASSERT_THAT(keys(file), ElementsAre("shards", "limits.nodes"));
  EXPECT_EQ(file.keys[0].place, "hub.toml:2:1");
  EXPECT_EQ(file.keys[0].value.place, "hub.toml:2:10");
  EXPECT_EQ(file.keys[0].origin, "hub.toml:2");
  EXPECT_EQ(file.keys[1].place, "hub.toml:5:3");
  EXPECT_EQ(file.keys[1].value.place, "hub.toml:5:13");
}

TEST(TomlFile, TellsTheKindsApart) {
  const TomlFile file =
      read_toml("a = 1\nb = 'x'\nc = true\nd = 1.5\ne = 1979-05-27\nf = ['x', 2]\n[g]\n", "f");
  ASSERT_THAT(file.keys, SizeIs(7));
  using Kind = ConfigValue::Kind;
  const Kind kinds[] = {Kind::integer, Kind::text, Kind::boolean, Kind::fraction,
                        Kind::time,    Kind::list, Kind::table};
  for (std::size_t i = 0; i < 7; ++i) EXPECT_EQ(file.keys[i].value.kind, kinds[i]) << i;
  ASSERT_THAT(file.keys[5].value.items, SizeIs(2));
  EXPECT_EQ(file.keys[5].value.items[0].text, "x");
  EXPECT_EQ(file.keys[5].value.items[1].place, "f:6:11");
}

TEST(TomlFile, EveryWayToWriteALimitIsTheSameKey) {
  EXPECT_THAT(keys(read_toml("[limits]\nnodes = 1", "f")), ElementsAre("limits.nodes"));
  EXPECT_THAT(keys(read_toml("limits.nodes = 1", "f")), ElementsAre("limits.nodes"));
  EXPECT_THAT(keys(read_toml("limits = { nodes = 1 }", "f")), ElementsAre("limits.nodes"));
}

TEST(TomlFile, TellsTheFirstSyntaxErrorAndReadsNothing) {
  const TomlFile file = read_toml("hub_id = 3\nshards = \nbad line\n", "f");
  ASSERT_THAT(places(file), ElementsAre("f:2:10"));
  EXPECT_THAT(file.faults[0].sentence, StartsWith("this is not TOML: "));
  EXPECT_THAT(file.faults[0].sentence, HasSubstr("nothing else of this file was read"));
  EXPECT_THAT(file.keys, IsEmpty());
}

TEST(TomlFile, TellsWhereTextIsNoUtf8) {
  for (const std::string line :
       {"\xe4 = 1", "# Gr\xc3\xb6\xdf\x65", "x = '\xff\xff'", "\xff\xfe"}) {
    const TomlFile file = read_toml("shards = 1\n" + line + "\nhub_id = 3\n", "f");
    ASSERT_THAT(places(file), ElementsAre("f:2:1")) << line;
    EXPECT_THAT(file.faults[0].sentence, HasSubstr("not UTF-8"));
    EXPECT_THAT(file.keys, IsEmpty());
  }
}

TEST(TomlFile, RefusesATableWithoutAName) {
  for (const std::string header : {"[?]", "[[?]]", "[ . ]", "[", "[[", "[]", "[=", "[\x01"}) {
    const TomlFile file = read_toml("shards = 2\n" + header + "\nhub_id = 3\n", "f");
    EXPECT_THAT(places(file), ElementsAre(StartsWith("f:2:"))) << header;
  }
}

TEST(TomlFile, RefusesLettersThatAKeyCannotHave) {
  for (const std::string line : {"gr\xc3\xb6\xc3\x9f = 3", "shards = \xc3\xb6", "id = 3\xc3\xa9"}) {
    EXPECT_THAT(places(read_toml(line + "\n", "f")), ElementsAre(StartsWith("f:1:"))) << line;
  }
}

TEST(TomlFile, RefusesAKeyGivenTwice) {
  const TomlFile file = read_toml("shards = 1\n  shards = 2\n", "f");
  ASSERT_THAT(places(file), ElementsAre(StartsWith("f:2:")));
  EXPECT_EQ(file.faults[0].sentence, "'shards' is given twice; leave one of them out");
}

TEST(TomlFile, RefusesANumberThatDoesNotFit) {
  EXPECT_THAT(read_toml("a = 9223372036854775807\n", "f").faults, IsEmpty());
  for (const std::string number :
       {"9223372036854775808", "-99999999999999999999", "0xfffffffffffffffff"}) {
    const TomlFile file = read_toml("[limits]\na = " + number + " # c\n", "f");
    ASSERT_THAT(places(file), ElementsAre(StartsWith("f:2:"))) << number;
    EXPECT_THAT(file.faults[0].sentence, HasSubstr("does not fit in 64 bits"));
  }
}

TEST(TomlFile, RefusesListsAndTextsThatAreNotClosed) {
  for (const std::string open :
       {"a = [", "a = [ 'x'", "a = [[", "a = \"\"\"x", "a = '''x\n", "a = 'x"}) {
    const TomlFile file = read_toml("shards = 2\n" + open + "\nhub_id = 2\n", "f");
    EXPECT_THAT(file.faults, SizeIs(1)) << open;
  }
}

TEST(TomlFile, TakesAMarkOfTheEncodingAndForeignLineEnds) {
  const TomlFile file = read_toml("\xEF\xBB\xBF[limits] # all\r\na = 1\r\nb = [\r\n]\r\n", "f");
  EXPECT_THAT(keys(file), ElementsAre("limits.a", "limits.b"));
}

TEST(TomlFile, OfAnUnknownTableItsNameIsEnough) {
  EXPECT_THAT(keys(read_toml("[limts]\nnodes = 2\n", "f")), ElementsAre("limts"));
}

TEST(TomlFile, AKeyOfMorePartsThanAnyHasIsNotLookedAt) {
  const auto chain = [](std::size_t dots) {
    std::string key = "a";
    for (std::size_t i = 0; i < dots; ++i) key += ".a";
    return key;
  };
  EXPECT_THAT(read_toml(chain(64) + " = 1\n", "f").faults, IsEmpty());
  EXPECT_THAT(read_toml("[" + chain(64) + "]\n", "f").faults, IsEmpty());
  EXPECT_THAT(
      read_toml("x = [" + std::string(999, ' ') + "'" + chain(999) + "']\n# " + chain(999) + " =",
                "f")
          .faults,
      IsEmpty());
  for (const std::size_t dots : {std::size_t{65}, kConfigBytesMax / 2 - 100}) {
    for (const std::string& line :
         {chain(dots) + " = 1", "[" + chain(dots) + "]", "x = {" + chain(dots) + "=1}"}) {
      const TomlFile file = read_toml("\n " + line + "\nshards = 1\n", "f");
      ASSERT_THAT(places(file), ElementsAre("f:2:1")) << dots;
      EXPECT_THAT(file.faults[0].sentence, HasSubstr("no key has so many parts"));
    }
  }
}

TEST(TomlFile, TakesItsMostBytesAndNotOneMore) {
  std::string text = "shards = 1\n#";
  text.resize(kConfigBytesMax, ' ');
  EXPECT_THAT(keys(read_toml(text, "f")), ElementsAre("shards"));
  const TomlFile over = read_toml(text + " ", "f");
  EXPECT_THAT(over.keys, IsEmpty());
  ASSERT_THAT(over.faults, SizeIs(1));
  EXPECT_THAT(over.faults[0].sentence, HasSubstr("1048576 bytes"));
}

TEST(TomlFile, QuotesSoThatItReadsBackEqual) {
  const std::string odd = "a \"b\" \\ \n\t\x7f \xc3\xa4";
  const TomlFile file = read_toml("x = " + toml_quoted(odd), "f");
  ASSERT_THAT(file.faults, IsEmpty());
  EXPECT_EQ(file.keys[0].value.text, odd);
}

}  // namespace
}  // namespace gimnet::hub
