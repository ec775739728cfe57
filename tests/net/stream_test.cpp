#include "net/stream.hpp"

#include <gtest/gtest.h>

namespace gimnet::net {
namespace {

TEST(Interest, IsReadIfTheOwnerMayAndWrittenWhileAnythingWaits) {
  for (const bool may_read : {false, true}) {
    for (const bool blocked : {false, true}) {
      for (const std::size_t pending : {0u, 1u, 16u}) {
        const Interest interest = interest_of(may_read, blocked, pending);
        EXPECT_EQ(interest.read, may_read);
        EXPECT_EQ(interest.write, blocked || pending > 0);
      }
    }
  }
}

}  // namespace
}  // namespace gimnet::net
