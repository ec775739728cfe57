#include "tests/client/gimi/gimi_c_test.h"

#include <gtest/gtest.h>

#include <thread>

#include "gimnet/gimi.h"
#include "tests/client/gimi/support/hub_process.hpp"

// gimnet/gimi.h as programs in C use it; gimi_c_test.c has what they do.

namespace gimnet {
namespace {

TEST(GimiC, AProgramTalks) {
  const test::HubProcess hub;
  EXPECT_EQ(gimi_c_talk(hub.url().c_str()), 0) << gimi_error_text();
}

TEST(GimiC, ABatchHoldsManyMessages) {
  const test::HubProcess hub;
  EXPECT_EQ(gimi_c_batch(hub.url().c_str()), 0) << gimi_error_text();
}

TEST(GimiC, MisuseIsAnswered) {
  const test::HubProcess hub;
  EXPECT_EQ(gimi_c_misuse(hub.url().c_str()), 0) << gimi_error_text();
}

TEST(GimiC, OptionsAndRecordsMayGrow) {
  const test::HubProcess hub;
  EXPECT_EQ(gimi_c_later_versions(hub.url().c_str()), 0) << gimi_error_text();
}

TEST(GimiC, ClosingAHandleEndsTheWaitOfAnotherThread) {
  const test::HubProcess hub;
  gimi_node_options options{};
  options.struct_size = sizeof options;
  options.hub = hub.url().c_str();
  gimi_handle node = 0;
  gimi_handle subscription = 0;
  gimi_handle watch = 0;
  ASSERT_EQ(gimi_join(&options, &node), GIMI_OK);
  ASSERT_EQ(gimi_subscribe(node, "robot/odom", nullptr, &subscription), GIMI_OK);
  ASSERT_EQ(gimi_watch(node, "nobody/*", 0, 5000, &watch), GIMI_OK);
  std::thread receives([&] {
    gimi_message message;
    EXPECT_EQ(gimi_receive(subscription, GIMI_FOREVER, &message), GIMI_CLOSED);
  });
  std::thread watches([&] {
    gimi_watch_event event;
    gimi_status status = GIMI_OK;
    while ((status = gimi_watch_receive(watch, GIMI_FOREVER, &event)) == GIMI_OK)
      gimi_watch_event_release(&event);
    EXPECT_EQ(status, GIMI_CLOSED);
  });
  EXPECT_EQ(gimi_close(subscription), GIMI_OK);
  EXPECT_EQ(gimi_close(watch), GIMI_OK);
  receives.join();
  watches.join();
  EXPECT_EQ(gimi_close(node), GIMI_OK);
}

}  // namespace
}  // namespace gimnet
