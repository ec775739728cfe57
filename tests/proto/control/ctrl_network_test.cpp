#include "proto/control/ctrl_network.hpp"

#include <gtest/gtest.h>

#include <string>

#include "proto/control/names.hpp"
#include "proto/frame/frame_parser.hpp"
#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto::ctrl {
namespace {

using test::Bytes;
using test::load_vector;

Bytes payload_of(const std::string& vector) {
  const auto bytes = load_vector(vector);
  return test::to_bytes(parse_frame(bytes, Origin::hub)->payload);
}

template <class Message>
void expect_request(const std::string& vector, std::uint16_t request, const Message& message) {
  const auto payload = payload_of(vector);
  const auto decoded = decode<Message>(payload);
  ASSERT_TRUE(decoded) << decoded.error().sentence;
  EXPECT_EQ(*decoded, message) << vector;
  EXPECT_EQ(encode(message, request), payload) << vector;
}

template <class Answer>
void expect_answer(const std::string& vector, std::uint16_t request, const Answer& answer) {
  const auto payload = payload_of(vector);
  const auto decoded = decode_answer<Answer>(payload);
  ASSERT_TRUE(decoded) << decoded.error().sentence;
  EXPECT_EQ(*decoded, answer) << vector;
  EXPECT_EQ(encode_answer(answer, request), payload) << vector;
}

HubRecord some_hub() {
  return {HubId{7}, "lab", HubId{7}, 0, 3, 1, 0, true, false, "0.1.0", {{HubId{8}, 10}}};
}

LinkRecord some_link() {
  return {"hall", HubId{8}, "tcp://10.0.0.8:7450",           LinkState::up,         true, 10, 180,
          -2'500, 90'000,   {0, 4'096, 2'048, 30, 40, 2, 1}, "nobody listens there"};
}

TEST(CtrlNetworkMessages, AreDecodedAndWrittenAsTheVectorsSay) {
  expect_request("ctrl/hubs", 9, Hubs{HubId{6}, 2});
  const HubRecord far{HubId{9},
                      "hall",
                      HubId{8},
                      70,
                      0,
                      0,
                      2,
                      true,
                      false,
                      "0.1.0",
                      {{HubId{8}, 60}, {HubId{12}, 10}}};
  expect_answer("ctrl/hubs_answer", 9, HubsAnswer{{some_hub(), far}, true});
  expect_request("ctrl/links", 10, LinksRequest{1});
  expect_answer("ctrl/links_answer", 10, LinksAnswer{{some_link()}, false});
  expect_request("ctrl/link_add", 11, LinkAdd{"tcp://10.0.0.9:7450", "far", 50, "http://p:1"});
  expect_answer("ctrl/link_add_answer", 11, LinkChanged<LinkAdd>{});
  expect_request("ctrl/link_remove", 12, LinkRemove{"far"});
  expect_answer("ctrl/link_remove_answer", 12, LinkChanged<LinkRemove>{});
  expect_request("ctrl/link_cost", 13, SetLinkCost{"far", 20});
  expect_answer("ctrl/link_cost_answer", 13, LinkChanged<SetLinkCost>{});
}

TEST(CtrlNetworkMessages, OmitWhatIsTheDefault) {
  EXPECT_EQ(encode(Hubs{}, 1).size(), kControlHeaderSize);
  EXPECT_EQ(encode(LinksRequest{}, 1).size(), kControlHeaderSize);
  const auto added = decode<LinkAdd>(encode(LinkAdd{"unix:/a", "", 0}, 1));
  ASSERT_TRUE(added);
  EXPECT_EQ(added->name, "");
  EXPECT_EQ(added->cost, 0);
  EXPECT_EQ(added->proxy, "");
}

TEST(CtrlNetworkMessages, AHubMayComeWithItsIdAlone) {
  bitestream::Writer body;
  body.put_u16(1, 0);
  body.begin_nested(3);
  body.put_u16(1, 5);
  body.end_nested();
  const auto answer =
      decode_answer<HubsAnswer>(assemble_control({HubsAnswer::kOperation, 1}, body));
  ASSERT_TRUE(answer);
  HubRecord hub;
  hub.hub = HubId{5};
  EXPECT_EQ(answer->hubs, std::vector{hub});
}

TEST(CtrlNetworkMessages, RefuseAListOfLinksThatIsCut) {
  for (const std::size_t size : {std::size_t{5}, 4 * kHubEdgesMax + 4}) {
    bitestream::Writer body;
    body.put_u16(1, 0);
    body.begin_nested(3);
    body.put_u16(1, 5);
    body.put_opaque(11, std::vector<std::byte>(size));
    body.end_nested();
    const auto answer =
        decode_answer<HubsAnswer>(assemble_control({HubsAnswer::kOperation, 1}, body));
    EXPECT_FALSE(answer) << size;
  }
}

TEST(CtrlNetworkMessages, EachStateHasAName) {
  EXPECT_STREQ(link_state_name(LinkState::dialling), "dialling");
  EXPECT_STREQ(link_state_name(LinkState::up), "up");
  for (std::uint16_t state = 0; state <= static_cast<std::uint16_t>(LinkState::ended); ++state)
    EXPECT_STRNE(link_state_name(LinkState{state}), "unknown") << state;
  EXPECT_STREQ(link_state_name(LinkState{7}), "unknown");
}

TEST(CtrlNetworkMessages, RecordsFitInTheBytesThatArePlannedForThem) {
  HubRecord hub = some_hub();
  hub.hub_name.assign(kNameBytesMax, 'n');
  hub.version.assign(kRemarkBytesMax, 'v');
  hub.edges.assign(kHubEdgesMax, {HubId{8}, 10});
  EXPECT_LE(
      encode_answer(HubsAnswer{{hub}, false}, 1).size() - encode_answer(HubsAnswer{}, 1).size(),
      page_bytes_max(hub));
  LinkRecord link = some_link();
  link.name.assign(kNameBytesMax, 'n');
  link.peer.assign(kRemarkBytesMax, 'p');
  link.last_error.assign(kSentenceBytesMax, 'e');
  link.counts.queue_full = UINT64_MAX;
  const LinksAnswer one{{link}, false};
  EXPECT_EQ(*decode_answer<LinksAnswer>(encode_answer(one, 1)), one);
  EXPECT_LE(
      encode_answer(LinksAnswer{{link}, false}, 1).size() - encode_answer(LinksAnswer{}, 1).size(),
      page_bytes_max(link));
}

}  // namespace
}  // namespace gimnet::proto::ctrl
