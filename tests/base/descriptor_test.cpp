#include "base/descriptor.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>

#include <cerrno>

namespace gimnet {
namespace {

bool is_open(int descriptor) { return ::fcntl(descriptor, F_GETFD) >= 0; }

TEST(Descriptor, IsClosedOnTheWayOut) {
  int number = -1;
  {
    const Descriptor descriptor(::open("/dev/null", O_RDONLY | O_CLOEXEC));
    ASSERT_TRUE(descriptor.is_open());
    number = descriptor.get();
    EXPECT_TRUE(is_open(number));
  }
  EXPECT_FALSE(is_open(number));
}

TEST(Descriptor, StaysOpenForWhomItWasReleasedTo) {
  int number = -1;
  {
    Descriptor descriptor(::open("/dev/null", O_RDONLY | O_CLOEXEC));
    number = descriptor.release();
    EXPECT_FALSE(descriptor.is_open());
  }
  EXPECT_TRUE(is_open(number));
  EXPECT_EQ(::close(number), 0);
}

TEST(Descriptor, MayBeNone) { EXPECT_FALSE(Descriptor(-1).is_open()); }

TEST(SystemText, IsTheSystemsSentence) {
  EXPECT_EQ(system_text(ENOENT), "No such file or directory");
}

}  // namespace
}  // namespace gimnet
