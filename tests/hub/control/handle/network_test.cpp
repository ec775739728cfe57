#include "hub/control/handle/network.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/control/ctrl_network.hpp"

// Tests name the members that matter and leave the others at their defaults, on purpose.
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"

namespace gimnet::hub {
namespace {

namespace ctrl = proto::ctrl;
using proto::Refusal;
using proto::Status;
using ::testing::HasSubstr;
using ::testing::SizeIs;

/// A network that says what it is told to.
class FakeNetwork final : public NetworkView {
 public:
  [[nodiscard]] std::vector<HubView> hubs() const override { return all_hubs; }
  [[nodiscard]] std::vector<LinkView> links() const override { return all_links; }
  [[nodiscard]] std::vector<Count> not_taken() const override { return {}; }
  std::string add_link(const DialledLink& link) override {
    added.push_back(link);
    return fault;
  }
  std::string remove_link(std::string_view name) override {
    removed = name;
    return fault;
  }
  std::string set_link_cost(std::string_view name, std::uint16_t cost) override {
    costs.emplace_back(name, cost);
    return fault;
  }

  std::vector<HubView> all_hubs;
  std::vector<LinkView> all_links;
  std::vector<DialledLink> added;
  std::string removed;
  std::vector<std::pair<std::string, std::uint16_t>> costs;
  std::string fault;
};

class NetworkHandlerTest : public ::testing::Test {
 protected:
  NetworkHandlerTest() {
    facts_.id = HubId{7};
    facts_.name = "lab";
    facts_.version = "1.2.3";
    HubView own{.hub = HubId{7}, .name = "lab", .reachable = true};
    own.neighbours = {{HubId{3}, 10}};
    HubView near{.hub = HubId{3}, .name = "hall", .distance = 1, .cost = 10, .via = HubId{3}};
    near.reachable = true;
    near.nodes = 5;
    near.services = 2;
    network_.all_hubs = {own, near, HubView{.hub = HubId{9}, .name = "gone"}};
  }

  template <class Answer, class Message>
  Result<Answer, Refusal> ask(Handler handler, const Message& message) {
    const proto::Payload payload = proto::encode(message, 5);
    HandlerContext context{facts_, limits_, membership_, watches_, {}, {}, effects_};
    context.network = alone_ ? nullptr : &network_;
    const Request request{session_, proto::split_control(payload)->header, payload};
    return proto::decode_answer<Answer>(handler(context, request));
  }
  Result<ctrl::LinkChanged<ctrl::LinkAdd>, Refusal> add(const ctrl::LinkAdd& link) {
    return ask<ctrl::LinkChanged<ctrl::LinkAdd>>(handle_link_add, link);
  }

  HubFacts facts_;
  Limits limits_;
  Membership membership_{Sessions::Options{HubId{7}, 2, Placement::spread}, limits_};
  Watches watches_{HubTitle{HubId{7}, "lab"}, 1, limits_};
  Effects effects_;
  Session session_;
  FakeNetwork network_;
  bool alone_ = false;
};

TEST_F(NetworkHandlerTest, AHubAloneKnowsItselfAndHasNoLinks) {
  alone_ = true;
  const auto hubs = ask<ctrl::HubsAnswer>(handle_hubs, ctrl::Hubs{});
  ASSERT_TRUE(hubs);
  ASSERT_THAT(hubs->hubs, SizeIs(1));
  EXPECT_EQ(hubs->hubs[0].hub, HubId{7});
  EXPECT_EQ(hubs->hubs[0].hub_name, "lab");
  EXPECT_EQ(hubs->hubs[0].version, "1.2.3");
  EXPECT_EQ(hubs->hubs[0].next_hop, HubId{7});
  EXPECT_TRUE(hubs->hubs[0].reachable);
  const auto links = ask<ctrl::LinksAnswer>(handle_links, ctrl::LinksRequest{});
  ASSERT_TRUE(links);
  EXPECT_THAT(links->links, SizeIs(0));
  EXPECT_EQ(add({"unix:/a"}).error().status, Status::not_supported);
  EXPECT_FALSE(ask<ctrl::LinkChanged<ctrl::LinkRemove>>(handle_link_remove, ctrl::LinkRemove{"a"}));
  EXPECT_FALSE(
      ask<ctrl::LinkChanged<ctrl::SetLinkCost>>(handle_link_cost, ctrl::SetLinkCost{"a", 1}));
}

TEST_F(NetworkHandlerTest, HubsAreToldByAscendingIdsWithTheWay) {
  const auto answer = ask<ctrl::HubsAnswer>(handle_hubs, ctrl::Hubs{});
  ASSERT_TRUE(answer);
  ASSERT_THAT(answer->hubs, SizeIs(3));
  EXPECT_FALSE(answer->more);
  EXPECT_EQ(answer->hubs[0], (ctrl::HubRecord{.hub = HubId{3},
                                              .hub_name = "hall",
                                              .next_hop = HubId{3},
                                              .cost = 10,
                                              .nodes = 5,
                                              .services = 2,
                                              .distance = 1}));
  EXPECT_EQ(answer->hubs[1].next_hop, HubId{7}) << "itself";
  EXPECT_EQ(answer->hubs[1].nodes, 0u) << "its own sessions count";
  EXPECT_EQ(answer->hubs[1].edges, (std::vector{ctrl::HubEdge{HubId{3}, 10}}));
  EXPECT_EQ(answer->hubs[2].next_hop, HubId{0});
  EXPECT_FALSE(answer->hubs[2].reachable);
}

TEST_F(NetworkHandlerTest, HubsComeInPages) {
  const auto first = ask<ctrl::HubsAnswer>(handle_hubs, ctrl::Hubs{.records_max = 2});
  ASSERT_TRUE(first);
  EXPECT_THAT(first->hubs, SizeIs(2));
  EXPECT_TRUE(first->more);
  const auto rest = ask<ctrl::HubsAnswer>(handle_hubs, ctrl::Hubs{HubId{7}, 2});
  ASSERT_TRUE(rest);
  ASSERT_THAT(rest->hubs, SizeIs(1));
  EXPECT_EQ(rest->hubs[0].hub, HubId{9});
  EXPECT_FALSE(rest->more);
}

TEST_F(NetworkHandlerTest, LinksAreToldByTheirNamesInPages) {
  LinkView up{.name = "b", .hub = HubId{3}, .peer = "tcp://h:1", .state = ctrl::LinkState::up};
  up.dialled = true;
  up.cost = 12;
  up.rtt_us = 80;
  up.clock_offset_ns = -5;
  up.clock_error_ns = 40;
  up.accepted = 1;
  up.delivered = 2;
  up.dropped = 4;
  up.unsure = 3;
  up.queued_bytes = 5;
  up.sent_bytes = 6;
  up.received_bytes = 7;
  up.last_error = "it broke";
  network_.all_links = {up, LinkView{.name = "c"}, LinkView{.name = "a"}};
  const auto first = ask<ctrl::LinksAnswer>(handle_links, ctrl::LinksRequest{.records_max = 2});
  ASSERT_TRUE(first);
  ASSERT_THAT(first->links, SizeIs(2));
  EXPECT_TRUE(first->more);
  EXPECT_EQ(first->links[0].name, "a");
  EXPECT_EQ(first->links[1], (ctrl::LinkRecord{"b",
                                               HubId{3},
                                               "tcp://h:1",
                                               ctrl::LinkState::up,
                                               true,
                                               12,
                                               80,
                                               -5,
                                               40,
                                               {5, 6, 7, 1, 2, 4, 3},
                                               "it broke"}));
  const auto rest = ask<ctrl::LinksAnswer>(handle_links, ctrl::LinksRequest{2, 2});
  ASSERT_TRUE(rest);
  ASSERT_THAT(rest->links, SizeIs(1));
  EXPECT_EQ(rest->links[0].name, "c");
  EXPECT_FALSE(rest->more);
}

TEST_F(NetworkHandlerTest, AddsALink) {
  ASSERT_TRUE(add({"tcp://127.0.0.1:7451", "lab", 20}));
  ASSERT_TRUE(add({"unix:/run/hub"}));
  ASSERT_TRUE(add({"tcp://127.0.0.1:7451", "far", 0, "http://ann:secret@p:1"}));
  ASSERT_THAT(network_.added, SizeIs(3));
  EXPECT_EQ(network_.added[2].proxy, "http://ann:secret@p:1");
  EXPECT_EQ(network_.added[0].address.url(), "tcp://127.0.0.1:7451");
  EXPECT_EQ(network_.added[0].name, "lab");
  EXPECT_EQ(network_.added[0].cost, 20);
  EXPECT_EQ(network_.added[1].name, "unix:/run/hub");
}

TEST_F(NetworkHandlerTest, AddsNoLinkThatIsWrong) {
  EXPECT_EQ(add({"lab:7451"}).error().status, Status::bad_request);
  EXPECT_THAT(add({"lab:7451"}).error().sentence, HasSubstr("did you mean tcp://lab:7451?"));
  EXPECT_THAT(add({"unix:/a", "a b"}).error().sentence, HasSubstr("'a b'"));
  EXPECT_THAT(add({"tcp://lab:7451"}).error().sentence, HasSubstr("insecure = true"));
  EXPECT_THAT(add({"unix:/a", "", 0, "http://p:1"}).error().sentence,
              HasSubstr("no proxy reaches unix:/a"));
  EXPECT_THAT(add({"tcp://127.0.0.1:1", "", 0, "http://a:secret@p"}).error().sentence,
              HasSubstr("a:***@p"));
  EXPECT_THAT(network_.added, SizeIs(0));
  facts_.insecure = true;
  EXPECT_TRUE(add({"tcp://lab:7451"}));
  network_.fault = "there is a link 'lab' already";
  EXPECT_EQ(add({"tcp://lab:7451"}).error().sentence, network_.fault);
}

TEST_F(NetworkHandlerTest, RemovesALinkAndChangesItsCost) {
  using Removed = ctrl::LinkChanged<ctrl::LinkRemove>;
  using Priced = ctrl::LinkChanged<ctrl::SetLinkCost>;
  EXPECT_TRUE(ask<Removed>(handle_link_remove, ctrl::LinkRemove{"lab"}));
  EXPECT_EQ(network_.removed, "lab");
  EXPECT_TRUE(ask<Priced>(handle_link_cost, ctrl::SetLinkCost{"lab", 50}));
  EXPECT_EQ(network_.costs, (std::vector{std::pair{std::string{"lab"}, std::uint16_t{50}}}));
  network_.fault = "there is no link 'lab'";
  EXPECT_EQ(ask<Removed>(handle_link_remove, ctrl::LinkRemove{"lab"}).error().status,
            Status::not_found);
  EXPECT_EQ(ask<Priced>(handle_link_cost, ctrl::SetLinkCost{"lab", 0}).error().sentence,
            network_.fault);
}

}  // namespace
}  // namespace gimnet::hub
