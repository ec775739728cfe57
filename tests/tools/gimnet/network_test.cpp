#include "tools/gimnet/network.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <variant>

#include "tools/gimnet/command_line.hpp"

// Tests name the members that matter and leave the others at their defaults, on purpose.
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"

namespace gimnet::tool {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;

std::variant<ToolOptions, CommandEnding> parse(std::vector<const char*> words) {
  words.insert(words.begin(), "gimnet");
  return parse_command_line(static_cast<int>(words.size()), words.data());
}

ToolOptions options(const std::vector<const char*>& words) {
  const auto parsed = parse(words);
  const auto* ending = std::get_if<CommandEnding>(&parsed);
  EXPECT_EQ(ending, nullptr) << ending->text;
  return ending == nullptr ? std::get<ToolOptions>(parsed) : ToolOptions{};
}

std::string fault(const std::vector<const char*>& words) {
  const auto parsed = parse(words);
  const auto* ending = std::get_if<CommandEnding>(&parsed);
  EXPECT_NE(ending, nullptr);
  if (ending == nullptr) return {};
  EXPECT_EQ(ending->code, ExitCode::usage);
  return ending->text;
}

/// Hubs 1 and 2 are linked; hub 2 tells of hub 3, which tells of nobody.
std::vector<NetworkHub> some_hubs() {
  NetworkHub own{.hub_id = 1, .name = "lab", .version = "0.1.0"};
  own.next_hop = 1;
  own.nodes = 3;
  own.services = 1;
  own.reachable = true;
  own.edges = {{2, 10}};
  NetworkHub near{.hub_id = 2, .name = "a\"b", .distance = 1, .cost = 12, .next_hop = 2};
  near.reachable = true;
  near.edges = {{1, 12}, {3, 10}};
  return {own, near, NetworkHub{.hub_id = 3, .name = "gone"}};
}

LinkRecord some_link() {
  LinkRecord link{.name = "hall", .hub_id = 2, .peer = "tcp://h:1", .state = "up"};
  link.dialled = true;
  link.cost = 12;
  link.rtt_us = 120;
  link.clock_offset_ns = -1'500;
  link.clock_error_ns = 60'000;
  link.sent_bytes = 1;
  link.received_bytes = 2;
  return link;
}

TEST(NetworkCommands, AreUnderstood) {
  EXPECT_EQ(options({"hubs"}).command, Command::hubs);
  EXPECT_EQ(options({"links", "--hub-id", "2"}).hub_id, 2u);
  EXPECT_EQ(options({"routes", "robot", "--hub-id=4094"}).target, "robot");
  EXPECT_TRUE(options({"graph", "--dot"}).dot);
  EXPECT_EQ(options({"graph", "--ascii"}).command, Command::graph);
  EXPECT_TRUE(options({"status", "--all", "--json"}).all);
  EXPECT_EQ(options({"status", "--hub-id", "7"}).hub_id, 7u);
}

TEST(NetworkCommands, WrongWordsAreTold) {
  EXPECT_THAT(fault({"graph", "--dot", "--json"}),
              HasSubstr("--ascii, --dot and --json contradict"));
  EXPECT_THAT(fault({"graph", "--dot", "--ascii"}), HasSubstr("contradict each other"));
  EXPECT_THAT(fault({"status", "--all", "--hub-id", "2"}), HasSubstr("--all and --hub-id"));
  EXPECT_THAT(fault({"links", "--hub-id", "0"}),
              HasSubstr("the hub of the network to ask, 1 to 4094"));
  EXPECT_THAT(fault({"links", "--hub-id", "4095"}), HasSubstr("1 to 4094"));
  EXPECT_THAT(fault({"routes"}), HasSubstr("node is missing: name or id"));
  EXPECT_THAT(fault({"routes", "robot/*"}), HasSubstr("is a pattern"));
  EXPECT_THAT(fault({"hubs", "all"}), HasSubstr("'all' is one word too many"));
  EXPECT_THAT(fault({"grap"}), HasSubstr("did you mean graph?"));
}

TEST(NetworkText, OfHubs) {
  EXPECT_EQ(
      json_of(some_hubs()),
      "[{\"id\":1,\"name\":\"lab\",\"version\":\"0.1.0\",\"distance\":0,\"cost\":0,\"via\":1,"
      "\"nodes\":3,\"services\":1,\"reachable\":true,\"too_far\":false},"
      "{\"id\":2,\"name\":\"a\\\"b\",\"version\":\"\",\"distance\":1,\"cost\":12,\"via\":2,"
      "\"nodes\":0,\"services\":0,\"reachable\":true,\"too_far\":false},"
      "{\"id\":3,\"name\":\"gone\",\"version\":\"\",\"distance\":null,\"cost\":null,\"via\":null,"
      "\"nodes\":0,\"services\":0,\"reachable\":false,\"too_far\":false}]\n");
  const std::string table = text_of(some_hubs());
  EXPECT_THAT(table, HasSubstr("HUB  NAME  STATE"));
  EXPECT_THAT(table, HasSubstr("unreachable  -         -     -"));
}

TEST(NetworkText, OfLinks) {
  EXPECT_EQ(
      json_of(std::vector{some_link()}),
      "[{\"name\":\"hall\",\"hub\":2,\"peer\":\"tcp://h:1\",\"state\":\"up\",\"dialled\":true,"
      "\"cost\":12,\"rtt_us\":120,\"clock_offset_us\":-1.500,\"clock_error_us\":60.000,"
      "\"queued_bytes\":0,\"sent_bytes\":1,\"received_bytes\":2,\"accepted\":0,\"delivered\":0,"
      "\"dropped\":0,\"unsure\":0,\"queue_full\":0,\"last_error\":null}]\n");
  const LinkRecord dialling{.name = "n", .state = "dialling", .last_error = "nobody listens"};
  EXPECT_THAT(json_of(std::vector{dialling}),
              HasSubstr("\"hub\":null,\"peer\":\"\",\"state\":\"dialling\",\"dialled\":false,"
                        "\"cost\":null,\"rtt_us\":null,\"clock_offset_us\":null"));
  EXPECT_THAT(json_of(std::vector{dialling}), HasSubstr("\"last_error\":\"nobody listens\""));
  EXPECT_THAT(text_of(std::vector{dialling}), HasSubstr("nobody listens"));
  LinkRecord link = some_link();
  link.dropped = 4'711;
  EXPECT_THAT(text_of(std::vector{link}), HasSubstr("RECEIVED  DROPPED"));
  EXPECT_THAT(text_of(std::vector{link}), HasSubstr("  4711  "));
  EXPECT_THAT(text_of(std::vector{link}), HasSubstr("\nhall "));
  link.dialled = false;
  EXPECT_THAT(text_of(std::vector{link}), HasSubstr("\nfrom hub 2 ")) << "its name is the other's";
}

TEST(NetworkText, OfAWay) {
  const std::vector<RouteStep> way{{1, "lab", 2, 1, 12}, {2, "hall", 2, 0, 0}};
  EXPECT_EQ(json_of(way),
            "[{\"hub\":1,\"name\":\"lab\",\"next_hop\":2,\"distance\":1,\"cost\":12},"
            "{\"hub\":2,\"name\":\"hall\",\"next_hop\":2,\"distance\":0,\"cost\":0}]\n");
  EXPECT_THAT(text_of(way),
              HasSubstr("HUB  NAME  NEXT  DISTANCE  COST\n1    lab   2     1         12"));
}

TEST(NetworkGraph, JoinsBothEndsOfALinkAtTheHigherCost) {
  const std::vector<GraphEdge> edges = edges_of(some_hubs());
  ASSERT_THAT(edges, SizeIs(2));
  EXPECT_EQ(edges[0].a, 1u);
  EXPECT_EQ(edges[0].b, 2u);
  EXPECT_EQ(edges[0].cost, 12u);
  EXPECT_TRUE(edges[0].agreed);
  EXPECT_EQ(edges[1].b, 3u);
  EXPECT_FALSE(edges[1].agreed);
}

TEST(NetworkText, OfCostsThatAreNotMeasuredYet) {
  std::vector<NetworkHub> hubs = some_hubs();
  hubs[0].edges[0].cost = 0;
  hubs[1].cost = 0;
  EXPECT_THAT(json_of(hubs), HasSubstr("\"distance\":1,\"cost\":null,\"via\":2"));
  EXPECT_THAT(text_of(hubs), HasSubstr("reachable    1         -     2"));
  EXPECT_THAT(graph_json(hubs), HasSubstr("{\"a\":1,\"b\":2,\"cost\":null,\"agreed\":true}"));
  EXPECT_THAT(graph_ascii(hubs), HasSubstr("1 lab -- 2 (-)\n"));
  EXPECT_THAT(graph_dot(hubs), HasSubstr("1 -- 2 [label=\"-\"];"));
  const std::vector<RouteStep> way{{1, "lab", 2, 1, 0}, {2, "hall", 2, 0, 0}};
  EXPECT_THAT(json_of(way), HasSubstr("\"distance\":1,\"cost\":null}"));
  EXPECT_THAT(json_of(way), HasSubstr("\"distance\":0,\"cost\":0}"));
}

TEST(NetworkGraph, IsDrawnInThreeWays) {
  EXPECT_EQ(graph_ascii(some_hubs()),
            "1 lab -- 2 (12)\n2 a\"b -- 1 (12), 3 (10, one-sided)\n"
            "3 gone (unreachable) -- 2 (10, one-sided)\n");
  EXPECT_EQ(graph_dot(some_hubs()),
            "graph gimnet {\n  1 [label=\"1 lab\"];\n  2 [label=\"2 a\\\"b\"];\n"
            "  3 [label=\"3 gone\", style=dashed];\n  1 -- 2 [label=\"12\"];\n"
            "  2 -- 3 [label=\"10\", style=dashed];\n}\n");
  EXPECT_EQ(
      graph_json(some_hubs()),
      "{\"hubs\":[{\"id\":1,\"name\":\"lab\",\"reachable\":true},{\"id\":2,\"name\":\"a\\\"b\","
      "\"reachable\":true},{\"id\":3,\"name\":\"gone\",\"reachable\":false}],"
      "\"links\":[{\"a\":1,\"b\":2,\"cost\":12,\"agreed\":true},"
      "{\"a\":2,\"b\":3,\"cost\":10,\"agreed\":false}]}\n");
}

}  // namespace
}  // namespace gimnet::tool
