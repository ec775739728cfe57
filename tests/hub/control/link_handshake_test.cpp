#include "hub/control/link_handshake.hpp"

#include <gtest/gtest.h>

#include "net/dial_handshake.hpp"
#include "tests/hub/control/support/link_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::GoodbyeCode;

struct HandshakeRig : LinkRig {
  HandshakeRig() : LinkRig(1, {}) {}
  LinksOptions options = accepting();
  LinkHandshake handshake{{facts, limits, options, links.network()}};

  std::optional<proto::Goodbye> judge(const proto::Hello& hello, const char* transport = "tcp") {
    Stranger stranger;
    stranger.peer = PeerInfo{transport, "somewhere"};
    return handshake.refusal(stranger, hello);
  }
};

proto::Hello hello() {
  proto::Hello hello;
  hello.role = proto::Role::hub;
  hello.introduction.emplace();
  hello.introduction->hub.hub = HubId{2};
  hello.introduction->link_name = "up";
  return hello;
}

TEST(LinkHandshake, NeedsAnIntroduction) {
  HandshakeRig rig;
  EXPECT_FALSE(rig.judge(hello()));
  proto::Hello bare = hello();
  bare.introduction.reset();
  EXPECT_EQ(rig.judge(bare)->code, GoodbyeCode::malformed);
  proto::Hello nameless = hello();
  nameless.introduction->link_name.clear();
  EXPECT_EQ(rig.judge(nameless)->code, GoodbyeCode::malformed);
}

TEST(LinkHandshake, RefusesFeaturesThatItDoesNotHave) {
  HandshakeRig rig;
  proto::Hello later = hello();
  later.introduction->features_required = 1;
  EXPECT_EQ(rig.judge(later)->code, GoodbyeCode::bad_version);
}

TEST(LinkHandshake, OverAUnixSocketOnlyAdministratorsMayLink) {
  HandshakeRig rig;
  const auto refusal = rig.judge(hello(), "unix");
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->code, GoodbyeCode::not_allowed);
}

TEST(LinkHandshake, TheLongestHelloFits) {
  HandshakeRig rig;
  rig.facts.name = std::string(255, 'n');
  rig.facts.version = std::string(300, 'v');
  DialledLink to = LinkRig::dialling(std::string(255, 'l'), 65'535).dial.front();
  const HubLink link(LinkNumber{1}, to);
  const auto bytes = net::encode_hello(rig.handshake.hello_for(link, UINT64_MAX));
  EXPECT_LE(bytes.size(), proto::kAdmissionBytesMax);
}

}  // namespace
}  // namespace gimnet::hub
