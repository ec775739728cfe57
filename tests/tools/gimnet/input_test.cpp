#include "tools/gimnet/input.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <string>
#include <thread>

namespace gimnet::tool {
namespace {

class FileContentTest : public testing::Test {
 protected:
  void TearDown() override { std::remove(path_.c_str()); }
  void write(const std::string& text) const { std::ofstream(path_, std::ios::binary) << text; }
  [[nodiscard]] static std::string text_of(const FileContent& content) {
    return {reinterpret_cast<const char*>(content.bytes().data()), content.bytes().size()};
  }
  std::string path_ = testing::TempDir() + "file_content_test." + std::to_string(::getpid());
};

TEST_F(FileContentTest, ReadsAllOfIt) {
  for (const std::size_t size : {0u, 1u, 65'537u, 3'000'000u}) {
    const std::string text(size, 'x');
    write(text);
    EXPECT_EQ(text_of(FileContent::read(path_, 1u << 30).or_throw()), text);
  }
}

TEST_F(FileContentTest, ReadsAPipeWhoseSizeIsNotKnown) {
  ASSERT_EQ(::mkfifo(path_.c_str(), 0600), 0);
  const std::string text(3'000'001, 'p');
  std::thread writing([&] { write(text); });
  EXPECT_EQ(text_of(FileContent::read(path_, 1u << 30).or_throw()), text);
  writing.join();
}

TEST_F(FileContentTest, RefusesWhatIsTooLargeByOne) {
  write("12345");
  EXPECT_EQ(text_of(FileContent::read(path_, 5).or_throw()), "12345");
  const auto refused = FileContent::read(path_, 4);
  EXPECT_TRUE(refused.is(Status::too_large));
  EXPECT_NE(refused.failure().sentence.find(path_), std::string::npos);
}

TEST_F(FileContentTest, RefusesAnEndlessDevice) {
  EXPECT_TRUE(FileContent::read("/dev/zero", 1u << 22).is(Status::too_large));
}

TEST_F(FileContentTest, SaysWhatCannotBeRead) {
  const auto missing = FileContent::read(path_, 5);
  EXPECT_TRUE(missing.is(Status::system));
  EXPECT_EQ(missing.failure().sentence, "cannot read " + path_ + ": No such file or directory");
  EXPECT_TRUE(FileContent::read("/", 5).is(Status::system));
}

}  // namespace

namespace {

class Pipe {
 public:
  Pipe() { EXPECT_EQ(::pipe(ends_.data()), 0); }
  ~Pipe() {
    ::close(ends_[0]);
    end();
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  [[nodiscard]] int reader() const { return ends_[0]; }
  void write(const std::string& text) {
    EXPECT_EQ(::write(ends_[1], text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  void end() {
    if (ends_[1] >= 0) ::close(ends_[1]);
    ends_[1] = -1;
  }

 private:
  std::array<int, 2> ends_{};
};

TEST(LineInput, GivesLinesAndAnUnfinishedLast) {
  Pipe pipe;
  pipe.write("first\n\nthird\nlast");
  pipe.end();
  LineInput input(pipe.reader());
  std::string_view line;
  for (const char* wanted : {"first", "", "third", "last"}) {
    ASSERT_EQ(input.next(line), LineInput::State::line);
    EXPECT_EQ(line, wanted);
  }
  EXPECT_EQ(input.next(line), LineInput::State::end);
  EXPECT_EQ(input.next(line), LineInput::State::end);
}

TEST(LineInput, KnowsWhetherAnotherLineIsHere) {
  Pipe pipe;
  pipe.write("first\nsecond\nhal");
  LineInput input(pipe.reader());
  std::string_view line;
  EXPECT_FALSE(input.has_line());
  ASSERT_EQ(input.next(line), LineInput::State::line);
  EXPECT_TRUE(input.has_line());
  ASSERT_EQ(input.next(line), LineInput::State::line);
  EXPECT_FALSE(input.has_line());
}

TEST(LineInput, TakesLongLines) {
  const std::string text(3'000'000, 'x');
  Pipe pipe;
  std::thread writer([&] {
    for (std::size_t at = 0; at < text.size(); at += 50'000) pipe.write(text.substr(at, 50'000));
    pipe.write("\nshort\n");
    pipe.end();
  });
  LineInput input(pipe.reader());
  std::string_view line;
  ASSERT_EQ(input.next(line), LineInput::State::line);
  EXPECT_EQ(line, text);
  ASSERT_EQ(input.next(line), LineInput::State::line);
  EXPECT_EQ(line, "short");
  EXPECT_EQ(input.next(line), LineInput::State::end);
  writer.join();
}

TEST(LineInput, StopsWaiting) {
  Pipe pipe;
  Pipe stop;
  stop.write("x");
  LineInput input(pipe.reader(), stop.reader());
  std::string_view line;
  EXPECT_EQ(input.next(line), LineInput::State::stopped);
}

TEST(LineInput, AsksWhetherToGoOnWhileNothingComes) {
  Pipe pipe;
  int asked = 0;
  LineInput input(pipe.reader(), -1, [&] {
    if (++asked == 1) pipe.write("late\n");
    return asked < 3;
  });
  std::string_view line;
  ASSERT_EQ(input.next(line), LineInput::State::line);
  EXPECT_EQ(line, "late");
  EXPECT_EQ(input.next(line), LineInput::State::given_up);
  EXPECT_EQ(asked, 3);
}

TEST(LineInput, SaysThatItCannotRead) {
  LineInput input(::getpid() + 100000);
  std::string_view line;
  EXPECT_EQ(input.next(line), LineInput::State::failed);
  EXPECT_NE(input.error(), 0);
}

}  // namespace

}  // namespace gimnet::tool
