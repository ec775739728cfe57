#include <gtest/gtest.h>

#include <thread>

#include "tests/client/nif/nif_c_test.h"
#include "tests/client/nif/support/fake_hub.hpp"

namespace gimnet::nif::test {
namespace {

TEST(NifC, AProgramInCTalks) {
  FakeHub hub;
  std::thread talking([&hub] { EXPECT_EQ(nif_c_talk(hub.url().c_str(), kPeerId), 0); });
  FakeConnection connection = hub.admit(make_welcome());
  const auto frame = connection.next_message();
  EXPECT_TRUE(frame);
  if (frame) {
    EXPECT_EQ(frame->payload(), "hello hub");
    EXPECT_EQ(frame->view().key, 42u);
  }
  connection.send_unicast(kPeerId, kOwnId, "hi");
  EXPECT_TRUE(connection.next_message()) << "GOODBYE";
  connection.close();
  talking.join();
}

}  // namespace
}  // namespace gimnet::nif::test
