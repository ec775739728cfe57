#include "hub/config/toml_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::StartsWith;
using ::testing::UnorderedElementsAre;
using ::testing::UnorderedElementsAreArray;

std::vector<std::string> places(const TomlFile& file) {
  std::vector<std::string> found;
  for (const Fault& fault : file.faults) found.push_back(fault.place);
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
  using Kind = Value::Kind;
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

TEST(TomlFile, TellsEverySyntaxErrorAtItsPlaceAndReadsTheRest) {
  const TomlFile file =
      read_toml("shards = \nhub_id = 3\nbad line\n= 4\n[limits]\nnodes = 1x\ngrace_ms = 5\n", "f");
  EXPECT_THAT(places(file), ElementsAre("f:1:10", "f:3:5", "f:4:1", "f:6:10"));
  EXPECT_THAT(keys(file), ElementsAre("hub_id", "limits.grace_ms"));
}

TEST(TomlFile, TellsWhereTextIsNoUtf8AndReadsTheRest) {
  const TomlFile file = read_toml(
      "\xe4 = 1\nshards = \n# Gr\xc3\xb6\xdf\x65\n[limits]\nnodes = 3\nx = '\xff\xff'\n", "f");
  EXPECT_THAT(places(file), UnorderedElementsAre("f:1:1", "f:2:10", "f:3:6", "f:6:6"));
  EXPECT_THAT(file.faults[0].sentence, HasSubstr("not UTF-8"));
  EXPECT_THAT(keys(file), Contains("limits.nodes"));
}

TEST(TomlFile, ATableWithoutAName) {
  for (const std::string header : {"[?]", "[[?]]", "[ . ]", "[", "[[", "[]", "[=", "[\x01"}) {
    const TomlFile file = read_toml("shards = 2\n" + header + "\nhub_id = 3\n", "f");
    EXPECT_THAT(file.faults, SizeIs(1)) << header;
    EXPECT_THAT(places(file), Each(StartsWith("f:2:"))) << header;
    EXPECT_THAT(keys(file), Contains("shards")) << header;
  }
}

TEST(TomlFile, LettersThatAKeyCannotHave) {
  const TomlFile file = read_toml(
      "gr\xc3\xb6\xc3\x9f"
      "e = 3\nshards = \xc3\xb6\nhub_id = 3\xc3\xa9\nhub_name = 'x'\n",
      "f");
  EXPECT_THAT(places(file),
              ElementsAre(StartsWith("f:1:"), StartsWith("f:2:"), StartsWith("f:3:")));
  EXPECT_THAT(keys(file), ElementsAre("hub_name"));
}

TEST(TomlFile, AKeyGivenTwiceIsTold) {
  const TomlFile file = read_toml("shards = 1\n  shards = 2\n", "f");
  ASSERT_THAT(file.faults, SizeIs(1));
  EXPECT_EQ(file.faults[0].line(), "f:2:3: 'shards' is given twice; leave one of them out");
}

TEST(TomlFile, AnErrorInALongerValueCostsThatValueAlone) {
  const TomlFile file = read_toml("hub_id = 1\nlisten = [\n  'a',\n  'b'\nshards = 2\n", "f");
  EXPECT_THAT(places(file), ElementsAre("f:2:1"));
  EXPECT_THAT(keys(file), ElementsAre("hub_id", "shards"));
  const TomlFile open = read_toml("hub_id = 1\nname = '''x\n\n", "f");
  EXPECT_THAT(places(open), SizeIs(1));
  EXPECT_THAT(keys(open), ElementsAre("hub_id"));
}

TEST(TomlFile, ANumberThatIsTooLargeIsToldWhereItStands) {
  const TomlFile file = read_toml(
      "[limits]\na = 9223372036854775807\nb =  9223372036854775808 # c\n\"\u00e4\" = "
      "-99999999999999999999\n"
      "c = 0xffff_ffff_ffff_ffff_f\nd = [1, 99999999999999999999]\ne = 2\n",
      "f");
  EXPECT_THAT(places(file), ElementsAre("f:3:6", "f:4:7", "f:5:5", "f:6:9"));
  EXPECT_EQ(file.faults[1].sentence,
            "no key can be '-99999999999999999999': it does not fit in 64 bits; give a number that "
            "is nearer to 0");
  EXPECT_THAT(keys(file), ElementsAre("limits.a", "limits.e"));
}

TEST(TomlFile, AListThatIsNotClosedHidesNothing) {
  for (const std::string list : {"listen = [", "listen = [ 'a'", "listen = [\n  'a',",
                                 "listen = [[", "listen = [\n\n# x\n"}) {
    const TomlFile file =
        read_toml(list + "\nshards = 2\n[limits]\nnodes = 1x\ngrace_ms = 5\n", "f");
    ASSERT_THAT(file.faults, SizeIs(2)) << list;
    EXPECT_EQ(file.faults[0].line(),
              "f:1:1: this is not TOML: the list that begins here is not closed; end it with ]");
    EXPECT_THAT(file.faults[1].place, HasSubstr(":10")) << "the value of nodes";
    EXPECT_THAT(keys(file), ElementsAre("shards", "limits.grace_ms")) << list;
  }
  const TomlFile twice = read_toml("a = [\nb = [\n[limits]\nnodes = 1\nc = [\n", "f");
  EXPECT_THAT(places(twice), UnorderedElementsAre("f:1:1", "f:2:1", "f:5:1"));
  EXPECT_THAT(keys(twice), ElementsAre("limits.nodes"));
}

TEST(TomlFile, ATextThatIsNotClosedIsToldWhereItBeginsAndHidesNothing) {
  for (const std::string quotes : {"\"\"\"", "'''"}) {
    for (const std::string content :
         {"", "a", "a\nb", "a\n# b\n\n[ c\nd = \n", "\n]\n", "a'b\"c"}) {
      const TomlFile file = read_toml("hub_id = 1\nhub_name = " + quotes + content +
                                          "\nshards = 2\n[limits]\nnodes = 1x\ngrace_ms = 5\n",
                                      "f");
      ASSERT_THAT(file.faults, SizeIs(2)) << quotes << content;
      EXPECT_EQ(file.faults[0].line(),
                "f:2:12: this is not TOML: the text that begins here is not closed; end it with "
                "its three quotes");
      EXPECT_THAT(file.faults[1].place, HasSubstr(":10")) << "the value of nodes";
      EXPECT_THAT(keys(file), ElementsAre("hub_id", "shards", "limits.grace_ms"))
          << quotes << content;
    }
  }
  const TomlFile last = read_toml("shards = 2\n\"\u00e4\" = [1, '''", "f");
  EXPECT_THAT(places(last), ElementsAre("f:2:11"));
  EXPECT_THAT(keys(last), ElementsAre("shards"));
}

TEST(TomlFile, ATextThatIsClosedIsNotTakenForAnOpenOne) {
  for (const std::string closed :
       {"\"\"\"\"\"\"", "\"\"\"a\\\"\"\"\"", "\"\"\"a\"\"\"\"\"", "'''a\\'''", "'''a''''",
        "\"a '''\" # '''", "'\"\"\"'", "\"\\\"\" # \"\"\""}) {
    const TomlFile file = read_toml("hub_name = " + closed + "\nlisten = [", "f");
    EXPECT_THAT(places(file), ElementsAre("f:2:1")) << closed;
    EXPECT_THAT(keys(file), ElementsAre("hub_name")) << closed;
  }
}

TEST(TomlFile, WhatStandsBelowABrokenHeaderIsNobodys) {
  const TomlFile file = read_toml("shards = 1\n[limits\nnodes = 2\n", "f");
  EXPECT_THAT(places(file), ElementsAre("f:2:8"));
  EXPECT_THAT(keys(file), ElementsAre("shards"));
}

TEST(TomlFile, OfAnUnknownTableItsNameIsEnough) {
  EXPECT_THAT(keys(read_toml("[limts]\nnodes = 2\n", "f")), ElementsAre("limts"));
}

TEST(TomlFile, EveryFaultOfALongFileIsTold) {
  constexpr std::size_t kLines = 3'000;
  std::string text = "[limits]\n";
  for (std::size_t i = 0; i < kLines; ++i)
    text += "bad line\nkey_" + std::to_string(i) + " = 1\nkey_0 = 2\n";
  const TomlFile file = read_toml(text, "f");
  ASSERT_THAT(file.faults, SizeIs(2 * kLines));
  EXPECT_THAT(file.keys, SizeIs(kLines));
  std::vector<std::string> expected;
  for (std::size_t i = 0; i < kLines; ++i) {
    expected.push_back("f:" + std::to_string(3 * i + 2) + ":5");
    expected.push_back("f:" + std::to_string(3 * i + 4) + ":1");
  }
  EXPECT_THAT(places(file), UnorderedElementsAreArray(expected));
  EXPECT_THAT(read_toml(text, "f", 5).faults, SizeIs(5));
}

// Parts are read one by one, and mean what they would in one.
TEST(TomlFile, AfterAnErrorItIsStillTheSameTable) {
  const auto rest = [](const std::string& text) { return keys(read_toml(text, "f")); };
  EXPECT_THAT(
      rest("a = 1\nbad\nb = 2\n[limits]\nc = 3\nbad\nd = 4\n[limits.e]\nf = 5\nbad\ng = 6\n"),
      ElementsAre("a", "b", "limits.c", "limits.d", "limits.e"));
  EXPECT_THAT(rest("[x]\na = 1\nbad\nb = 2\n[x.y]\nbad\n[limits]\nc = 3\n"),
              ElementsAre("x", "limits.c"));
  EXPECT_THAT(rest("[[x]]\na = 1\nbad\nb = 2\n[[x]]\nc = 3\nbad\nd = 4\n"), ElementsAre("x"));
  EXPECT_THAT(rest("limits.a = 1\nbad\nlimits.b = 2\n"), ElementsAre("limits.a", "limits.b"));
  EXPECT_THAT(rest("[limits]\r\na = 1\r\nbad\r\nb = 2\r\n"), ElementsAre("limits.a", "limits.b"));
  EXPECT_THAT(rest("\xEF\xBB\xBF[limits] # all\nbad\nb = 2\n"), ElementsAre("limits.b"));
  EXPECT_THAT(rest("a = [\n  ['x'],\n]\nbad\nb = 1\n"), ElementsAre("a", "b"));
}

TEST(TomlFile, AfterAnErrorWhatIsGivenTwiceIsToldAsBeforeIt) {
  const auto twice = [](const std::string& first, const std::string& second) {
    const TomlFile file = read_toml(first + "bad\n" + second, "f");
    EXPECT_THAT(file.faults, SizeIs(2)) << first << second;
    return file.faults.back().line();
  };
  EXPECT_EQ(twice("a = 1\n", " a = 2\n"), "f:3:2: 'a' is given twice; leave one of them out");
  EXPECT_EQ(twice("[limits]\na = 1\n", "a = 2\n"),
            "f:4:1: 'a' is given twice; leave one of them out");
  EXPECT_EQ(twice("[limits]\na = 1\n", "[limits]\nb = 2\n"),
            "f:4:1: 'limits' is given twice; leave one of them out");
  EXPECT_EQ(twice("a = 1\n", "[a]\n"), "f:3:1: 'a' is given twice; leave one of them out");
  EXPECT_EQ(twice("[a]\n[b]\n", "[a]\n"), "f:4:1: 'a' is given twice; leave one of them out");
}

// What begins so far above that it is not found costs what is below it.
TEST(TomlFile, AnErrorWhoseBeginningIsNotFoundIsTold) {
  const auto with = [](std::size_t bytes) {
    std::string text = "shards = 1\nname = \"\"\"\n";
    while (text.size() < bytes) text += "hub_id = 1\n";
    return read_toml(text + "\\q\n", "f");
  };
  const TomlFile shorter = with(3'000);
  EXPECT_THAT(shorter.faults, SizeIs(1));
  EXPECT_THAT(keys(shorter), ElementsAre("shards"));
  const TomlFile longer = with(kConfigBytesMax - 20);
  ASSERT_THAT(longer.faults, SizeIs(2));
  EXPECT_THAT(longer.faults[1].sentence, HasSubstr("what follows here cannot be made sense of"));
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
      ASSERT_THAT(places(file), ElementsAre("f:2:2")) << dots;
      EXPECT_THAT(file.faults[0].sentence, HasSubstr("no key has so many parts"));
      EXPECT_THAT(keys(file), ElementsAre("shards"));
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

TEST(TomlFile, BytesThatAreNoTextAreTold) {
  EXPECT_THAT(places(read_toml("shards = 1\n\xff\xfe", "f")), SizeIs(::testing::Ge(1u)));
}

TEST(TomlFile, QuotesSoThatItReadsBackEqual) {
  const std::string odd = "a \"b\" \\ \n\t\x7f \xc3\xa4";
  const TomlFile file = read_toml("x = " + toml_quoted(odd), "f");
  ASSERT_THAT(file.faults, IsEmpty());
  EXPECT_EQ(file.keys[0].value.text, odd);
}

}  // namespace
}  // namespace gimnet::hub
