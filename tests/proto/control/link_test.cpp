#include "proto/control/link.hpp"

#include <gtest/gtest.h>

#include <string>

#include "proto/control/names.hpp"
#include "proto/frame/frame_parser.hpp"
#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto {
namespace {

using test::Bytes;
using test::from_hex;
using test::load_vector;

Bytes payload_of(const std::string& vector) {
  const auto bytes = load_vector(vector);
  return test::to_bytes(parse_frame(bytes, Origin::hub)->payload);
}

TEST(OpeningBytes, AreThoseOfTheVector) {
  EXPECT_EQ(test::to_bytes(kOpening), load_vector("link/opening"));
  EXPECT_EQ(check_opening(kOpening), Opening::accepted);
}

TEST(OpeningBytes, AreAwaitedAsLongAsTheyFit) {
  for (std::size_t size = 0; size < kOpeningSize; ++size) {
    EXPECT_EQ(check_opening(std::span(kOpening).first(size)), Opening::need_more) << size;
  }
}

TEST(OpeningBytes, TellVersionAndProtocolApart) {
  EXPECT_EQ(check_opening(from_hex("47 49 4d 6e 65 74 01 07")), Opening::accepted)
      << "the minor version may differ";
  EXPECT_EQ(check_opening(from_hex("47 49 4d 6e 65 74 02")), Opening::bad_version);
  EXPECT_EQ(check_opening(from_hex("47 45")), Opening::other_protocol);
  EXPECT_EQ(check_opening(from_hex("48")), Opening::other_protocol);
}

Hello vector_hello() {
  Hello hello;
  hello.name = "robot";
  hello.token = from_hex("01 02 03 04 05 06 07 08");
  hello.epoch = 0x1122334455667788;
  hello.resume = true;
  hello.description = "a robot";
  hello.resume_epoch = 0x99;
  hello.resume_taken = 1000;
  hello.shard = 1;
  hello.former = NodeId{0x00700011};
  return hello;
}

TEST(HelloMessage, IsDecodedAndWrittenAsTheVectorSays) {
  const auto payload = payload_of("link/hello");
  const auto hello = decode<Hello>(payload);
  ASSERT_TRUE(hello);
  EXPECT_EQ(*hello, vector_hello());
  EXPECT_EQ(encode(vector_hello()), payload);
}

TEST(HelloMessage, HasDefaultsForAllThatIsAbsent) {
  const auto hello = decode<Hello>(payload_of("link/hello_smallest"));
  ASSERT_TRUE(hello);
  EXPECT_EQ(*hello, Hello{});
  EXPECT_EQ(*decode<Hello>(encode(Hello{})), Hello{});
}

TEST(HelloMessage, LetsABadNamePassSoThatItIsAnsweredAsSuch) {
  Hello hello;
  hello.name = std::string(300, 'a');
  EXPECT_EQ(decode<Hello>(encode(hello))->name, hello.name);
  EXPECT_FALSE(valid_name(hello.name));
}

TEST(HelloMessage, BoundsTokenAndDescription) {
  Hello hello;
  hello.token.resize(kTokenBytesMax);
  hello.description.assign(kDescriptionBytesMax, 'd');
  EXPECT_TRUE(decode<Hello>(encode(hello)));
  hello.token.resize(kTokenBytesMax + 1);
  EXPECT_FALSE(decode<Hello>(encode(hello)));

  bitestream::Writer body;
  body.put_text(8, std::string(kDescriptionBytesMax + 1, 'd'));
  EXPECT_FALSE(decode<Hello>(assemble_control({Hello::kOperation, 0}, body)));
}

TEST(HelloMessage, FitsInTheAdmissionBuffer) {
  Hello hello = vector_hello();
  hello.name.assign(kNameBytesMax, 'n');
  hello.token.resize(kTokenBytesMax);
  hello.description.assign(kDescriptionBytesMax, 'd');
  EXPECT_LE(kOpeningSize + kHeaderSize + encode(hello).size(), kAdmissionBytesMax);
}

TEST(HubIntroduction, ComesAsItWasSent) {
  HubIntroduction said;
  said.hub.hub = HubId{9};
  said.instance = HubInstance{77};
  said.configured = true;
  said.link_name = "up";
  said.cost = 40;
  said.keep_alive_ms = 250;
  said.silent_ms = 1'000;
  for (const std::uint64_t counts : {std::uint64_t{0}, UINT64_MAX}) {
    said.counts = counts;
    Hello hello;
    hello.introduction = said;
    EXPECT_EQ(decode<Hello>(encode(hello))->introduction, said);
    Welcome welcome;
    welcome.node = NodeId{9};
    welcome.hub = HubId{9};
    welcome.introduction = said;
    EXPECT_EQ(decode<Welcome>(encode(welcome))->introduction, said);
  }
}

TEST(WelcomeMessage, IsDecodedAndWrittenAsTheVectorSays) {
  Welcome welcome;
  welcome.node = NodeId{0x00700011};
  welcome.token = from_hex("01 02 03 04 05 06 07 08");
  welcome.hub = HubId{7};
  welcome.hub_name = "lab";
  welcome.epoch = 0x99;
  welcome.keep_alive_ms = 1000;
  welcome.silent_ms = 3000;
  welcome.hub_time_ns = 1767225600000000000;
  welcome.resumed = true;
  welcome.taken = 40;
  welcome.resume_buffer_bytes = 1 << 20;
  welcome.grace_ms = 30000;
  welcome.last_goodbye_code = static_cast<std::uint16_t>(GoodbyeCode::silent);
  welcome.last_goodbye_sentence = "nothing heard for 3 s";
  welcome.name = "robot";
  welcome.retained_bytes_max = 16 << 20;
  const auto payload = payload_of("link/welcome");
  const auto decoded = decode<Welcome>(payload);
  ASSERT_TRUE(decoded);
  EXPECT_EQ(*decoded, welcome);
  EXPECT_EQ(encode(welcome), payload);
}

TEST(WelcomeMessage, NeedsAnId) {
  const auto welcome = decode<Welcome>(from_hex("02 00 00 00"));
  ASSERT_FALSE(welcome);
  EXPECT_EQ(welcome.error().sentence, "WELCOME has no node id (key 1)");
}

TEST(GoodbyeMessage, IsDecodedAndWrittenAsTheVectorSays) {
  const Goodbye goodbye{GoodbyeCode::name_taken, "robot is held by 7.3"};
  const auto payload = payload_of("link/goodbye");
  EXPECT_EQ(*decode<Goodbye>(payload), goodbye);
  EXPECT_EQ(encode(goodbye), payload);
}

TEST(GoodbyeMessage, NamesItsCodes) {
  EXPECT_STREQ(goodbye_name(GoodbyeCode::done), "done");
  EXPECT_STREQ(goodbye_name(GoodbyeCode::slow_consumer), "slow_consumer");
  EXPECT_STREQ(goodbye_name(GoodbyeCode::no_memory), "no_memory");
  EXPECT_STREQ(goodbye_name(GoodbyeCode::renumbered), "renumbered");
  EXPECT_STREQ(goodbye_name(GoodbyeCode::oddities), "oddities");
  EXPECT_STREQ(goodbye_name(static_cast<GoodbyeCode>(kGoodbyeCount)), "unknown");
}

}  // namespace
}  // namespace gimnet::proto
