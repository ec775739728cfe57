#include "tools/gimnet/hub_status.hpp"

#include <gtest/gtest.h>

namespace gimnet::tool {
namespace {

HubStatus status() {
  HubStatus status;
  status.hub = {7, "lab", "1.2.3", 2, 5000, 1, 0};
  status.shards = {{0,
                    {{"accepted", 10},
                     {"delivered", 8},
                     {"queued", 1},
                     {"pinned_bytes_max", 50},
                     {"dropped.away", 1}}},
                   {1,
                    {{"accepted", 5},
                     {"copies", 3},
                     {"delivered", 8},
                     {"pinned_bytes_max", 20},
                     {"dropped.away", 0}}}};
  status.connections = {
      {Peer{(7u << 20) | 1}, "robot", 1, "tcp", "127.0.0.1:5", true, 9, 100, 1200, 20, 320, 3}};
  return status;
}

TEST(HubStatus, SumsShardsAndKeepsTheLargestOfMaxima) {
  const Counters counters = summed(status().shards);
  const Counters wanted{{"accepted", 15},         {"delivered", 16},   {"queued", 1},
                        {"pinned_bytes_max", 50}, {"dropped.away", 1}, {"copies", 3}};
  EXPECT_EQ(counters, wanted);
}

TEST(HubStatus, BalancesTheLedger) {
  Ledger ledger = ledger_of(summed(status().shards));
  EXPECT_EQ(ledger.dropped, 1u);
  EXPECT_EQ(
      text_of(ledger_of({{"accepted", 7}, {"dropped.away", 2}, {"dropped.wrong_way", 5}})),
      "ledger: 7 accepted + 0 copies = 0 delivered + 2 dropped + 5 by another way + 0 queued");
  EXPECT_TRUE(ledger.exact());
  ledger.queued = 0;
  EXPECT_FALSE(ledger.exact());
}

TEST(HubStatus, IsWrittenAsJson) {
  const std::string json = json_of(status());
  EXPECT_NE(json.find(R"("hub":{"id":7,"name":"lab","version":"1.2.3","shards":2)"),
            std::string::npos)
      << json;
  EXPECT_NE(
      json.find(
          R"("ledger":{"accepted":15,"copies":3,"delivered":16,"dropped":1,"queued":1,"exact":true})"),
      std::string::npos);
  EXPECT_NE(
      json.find(
          R"({"shard":1,"ledger":{"accepted":5,"copies":3,"delivered":8,"dropped":0,"queued":0},"counters":)"),
      std::string::npos)
      << "only the sum can be exact: " << json;
  EXPECT_NE(json.find(R"({"id":"7.1","name":"robot","shard":1,"transport":"tcp")"),
            std::string::npos);
  EXPECT_NE(
      json.find(
          R"("connected":true,"queued_bytes":9,"accepted":100,"received_bytes":1200,"delivered":20,)"
          R"("sent_bytes":320,"dropped":3,"missed":0,"queue_full":0})"),
      std::string::npos)
      << json;
}

TEST(HubStatus, IsWrittenForPeople) {
  const std::string text = text_of(status());
  EXPECT_NE(text.find("15 accepted + 3 copies = 16 delivered + 1 dropped + 1 queued\n"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("dropped.away: 1"), std::string::npos);
  EXPECT_NE(text.find("7.1  robot"), std::string::npos);
  EXPECT_NE(text.find("connected  100       20         3        0       9"), std::string::npos)
      << text;
}

TEST(HubStatus, NamesWhoseQueuesWereFull) {
  HubStatus full = status();
  full.shards[1].counters.emplace_back("dropped.queue_full", 20);
  EXPECT_EQ(text_of(full).find(" for "), std::string::npos) << "of an older hub nobody is known";
  full.connections[0].queue_full = 3;
  full.links.resize(2);
  full.links[0].name = "lab";
  full.links[0].hub_id = 8;
  full.links[0].queue_full = 16;
  const std::string text = text_of(full);
  EXPECT_NE(text.find("  dropped.queue_full: 20\n"
                      "    for link lab to hub 8: 16\n"
                      "    for node 7.1 robot: 3\n"
                      "    for others that have left: 1\n"),
            std::string::npos)
      << text;
  EXPECT_NE(json_of(full).find(R"("links":[{"name":"lab")"), std::string::npos);
}

TEST(HubStatus, NamesTenOfManyWhoseQueuesWereFull) {
  HubStatus full = status();
  full.shards[1].counters.emplace_back("dropped.queue_full", 1'000);
  full.connections.assign(12, full.connections[0]);
  for (std::size_t i = 0; i < 12; ++i) full.connections[i].queue_full = i + 1;
  const std::string text = text_of(full);
  EXPECT_NE(text.find("    for node 7.1 robot: 3\n"
                      "    for 2 others (--json names them): 3\n"
                      "    for others that have left: 922\n"),
            std::string::npos)
      << text;
}

}  // namespace
}  // namespace gimnet::tool
