#include "tools/gimnet/file_content.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

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
}  // namespace gimnet::tool
