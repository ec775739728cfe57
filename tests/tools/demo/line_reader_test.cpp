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
};

Outcome read_all(const std::string& path) {
  Outcome outcome;
  Result<LineReader> reader = LineReader::open(path);
  if (!reader) return {{}, reader.error().sentence};
  std::string_view line;
  while (true) {
    const Result<bool> more = reader->next(line);
    if (!more) return {outcome.lines, more.error().sentence};
    if (!*more) return outcome;
    outcome.lines.emplace_back(line);
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

TEST(LineReader, TakesALineOfTheLimitAndRefusesOneBeyond) {
  const std::string longest(LineReader::kLineBytesMax - 1, 'x');
  EXPECT_THAT(read_all(TemporaryFile(longest + "\nend\n").path()).lines,
              ElementsAre(longest, "end"));
  const TemporaryFile beyond("first\n" + longest + "xx\n");
  EXPECT_THAT(read_all(beyond.path()).error,
              HasSubstr(beyond.path() + ":2: the line is longer than 1 MiB"));
}

TEST(LineReader, SaysThatAnArchiveWasCut) {
  std::string text;
  for (int number = 0; number < 50'000; ++number) text += std::to_string(number * 7919) + "\n";
  const TemporaryFile file(text, true);
  std::filesystem::resize_file(file.path(), std::filesystem::file_size(file.path()) / 2);
  const Outcome outcome = read_all(file.path());
  EXPECT_FALSE(outcome.lines.empty());
  EXPECT_THAT(outcome.error, HasSubstr("ends too early"));
}

TEST(LineReader, SaysWhatIsWrongWithThePath) {
  EXPECT_THAT(read_all("/nowhere/at all").error,
              HasSubstr("cannot open /nowhere/at all: No such file"));
  EXPECT_THAT(read_all("/").error, HasSubstr("not a regular file"));
}

}  // namespace
}  // namespace gimnet::demo
