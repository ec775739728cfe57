#include "client/nif/handles.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/client/nif/support/fake_hub.hpp"

namespace gimnet::nif::test {
namespace {

TEST(Handles, AClosedHandleNeverComesBack) {
  FakeHub hub;
  nif_node* former = nullptr;
  for (int i = 0; i < 5; ++i) {
    Connected connected = connect_to(hub, default_options(), make_welcome());
    EXPECT_NE(connected.node.get(), former);
    EXPECT_EQ(nif_flush(former), NIF_CLOSED);
    former = connected.node.get();
    EXPECT_TRUE(find_node(former));
    connected.hub.close();
  }
}

TEST(Handles, RefusesWhatIsNoHandle) {
  for (const std::uintptr_t value : {std::uintptr_t{0}, std::uintptr_t{8}, std::uintptr_t{16}, ~std::uintptr_t{0}}) {
    const NodeRef node = find_node(reinterpret_cast<const nif_node*>(value));
    EXPECT_FALSE(node);
    EXPECT_EQ(node.status(), NIF_CLOSED);
  }
}

TEST(Handles, AChildIsToldThatTheHandleIsItsParents) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const bool right =
        nif_send_to(node, kPeerId, "", 0) == NIF_FORKED && nif_close(node) == NIF_OK && nif_close(node) == NIF_CLOSED;
    ::_exit(right ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(nif_send_to(node, kPeerId, "", 0), NIF_OK) << "the parent goes on";
}

}  // namespace
}  // namespace gimnet::nif::test
