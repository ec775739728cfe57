#include "tools/demo/line_reader.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/tools/demo/temporary_file.hpp"

namespace gimnet::demo {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

struct Outcome {
  std::vector<std::string> lines;
  std::string error;
  bool is_cut = false;
};

Outcome read_all(const std::string& path) {
  Outcome outcome;
  Result<LineReader> reader = LineReader::open(path);
  if (!reader) return {{}, reader.error().sentence, false};
  std::string_view line;
  while (true) {
    const Result<bool> more = reader->next(line);
    if (!more) return {outcome.lines, more.error().sentence, false};
    if (!*more) {
      outcome.is_cut = reader->is_cut();
      return outcome;
    }
    outcome.lines.emplace_back(reader->is_too_long() ? "(too long)" : line);
  }
}

TEST(LineReader, GivesEachLineWithoutItsEnd) {
  EXPECT_THAT(read_all(TemporaryFile("one\ntwo\r\n\nlast").path()).lines,
              ElementsAre("one", "two", "", "last"));
}

TEST(LineReader, AnEmptyFileHasNoLine) {
  EXPECT_TRUE(read_all(TemporaryFile("").path()).lines.empty());
}

TEST(LineReader, ReadsWhatGzipPacked) {
  std::string text;
  for (int number = 0; number < 50'000; ++number) text += std::to_string(number) + "\n";
  const Outcome outcome = read_all(TemporaryFile(text, true).path());
  ASSERT_EQ(outcome.lines.size(), 50'000U);
  EXPECT_EQ(outcome.lines[49'999], "49999");
  EXPECT_EQ(outcome.error, "");
}

TEST(LineReader, TakesALineOfTheLimitAndSkipsOneBeyond) {
  const std::string longest(LineReader::kLineBytesMax - 1, 'x');
  EXPECT_THAT(read_all(TemporaryFile(longest + "\nend\n").path()).lines,
              ElementsAre(longest, "end"));
  const std::string zeros(2 * LineReader::kLineBytesMax, '\0');
  for (const std::string& beyond : {longest + "x", zeros}) {
    EXPECT_THAT(read_all(TemporaryFile("first\n" + beyond + "\nend\n").path()).lines,
                ElementsAre("first", "(too long)", "end"));
    EXPECT_THAT(read_all(TemporaryFile("first\n" + beyond).path()).lines,
                ElementsAre("first", "(too long)"));
  }
}

TEST(LineReader, ALineEndsAtANul) {
  EXPECT_THAT(read_all(TemporaryFile(std::string("one\0two\nend\n", 12)).path()).lines,
              ElementsAre("one", "end"));
}

TEST(LineReader, GivesTheWholeLinesOfACutArchive) {
  std::string text;
  for (int number = 0; number < 50'000; ++number) text += std::to_string(number * 7919) + "\n";
  const TemporaryFile file(text, true);
  std::filesystem::resize_file(file.path(), std::filesystem::file_size(file.path()) / 2);
  const Outcome outcome = read_all(file.path());
  ASSERT_FALSE(outcome.lines.empty());
  EXPECT_EQ(outcome.lines.back(), std::to_string((outcome.lines.size() - 1) * 7919));
  EXPECT_EQ(outcome.error, "");
  EXPECT_TRUE(outcome.is_cut);
}

TEST(LineReader, SaysWhatIsWrongWithThePath) {
  EXPECT_THAT(read_all("/nowhere/at all").error,
              HasSubstr("cannot open /nowhere/at all: No such file"));
  EXPECT_THAT(read_all("/").error, HasSubstr("not a regular file"));
}

}  // namespace
}  // namespace gimnet::demo
