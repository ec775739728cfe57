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
  LinkHandshake handshake{{facts, limits, options, links.network(), links.all()}};

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
  for (const char* name : {"", "two words", "x\ngimnet: forged", "\x1b[2J"}) {
    proto::Hello named = hello();
    named.introduction->link_name = name;
    EXPECT_EQ(rig.judge(named)->code, GoodbyeCode::malformed) << name;
  }
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

TEST(LinkHandshake, TheRefusalOfATakenIdNamesItsHolder) {
  LinkedRigs hubs;
  hubs.link();
  LinkRig twin(2, LinkRig::dialling());
  twin.links.tick(twin.moment());
  proto::Hello hello = twin.dialled.back().hello;
  hello.introduction->hub.unique.bytes[5] = 9;
  hello.introduction->instance = proto::HubInstance{77};
  const auto refusal = hubs.a.admit(hello);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->sentence,
            "hub id 2 is taken by hub 'hub-2', linked at 127.0.0.1:5000; give one of them another "
            "one with --hub-id");
}

}  // namespace
}  // namespace gimnet::hub
