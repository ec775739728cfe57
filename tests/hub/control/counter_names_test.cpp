#include "hub/control/counter_names.hpp"

#include <gtest/gtest.h>

#include <map>

#include "proto/control/ctrl_network.hpp"

namespace gimnet::hub {
namespace {

template <class Counters>
std::map<std::string, std::uint64_t> read(const Counters& counters) {
  std::map<std::string, std::uint64_t> all;
  for_each_counter(counters, [&all](const std::string& name, std::uint64_t value) {
    EXPECT_TRUE(all.emplace(name, value).second) << name;
  });
  return all;
}

TEST(CounterNames, AreThoseOfTheFields) {
  ShardCounters counters;
  counters.accepted.add(3);
  counters.pinned_bytes_max.raise_to(9);
  const auto all = read(counters);
  EXPECT_EQ(all.at("accepted"), 3u);
  EXPECT_EQ(all.at("pinned_bytes_max"), 9u);
  EXPECT_EQ(all.at("delivered"), 0u);
}

TEST(CounterNames, DropsAreListedByReason) {
  ShardCounters counters;
  counters.dropped[static_cast<std::size_t>(proto::DropReason::queue_full)].add(4);
  const auto all = read(counters);
  EXPECT_EQ(all.at("dropped.queue_full"), 4u);
  EXPECT_EQ(all.at("dropped.wrong_source"), 0u);
  EXPECT_FALSE(all.contains("dropped.none"));
}

TEST(CounterNames, RefusalsAreListedByCode) {
  RefusalCounters counters;
  counters.count(proto::GoodbyeCode::no_memory);
  counters.count(static_cast<proto::GoodbyeCode>(proto::kGoodbyeCount));
  counters.garbage.add(2);
  counters.unfinished.add(3);
  counters.links_overrun.add(4);
  const auto all = read(counters);
  EXPECT_EQ(all.size(), proto::kGoodbyeCount + 4);
  EXPECT_EQ(all.at("refused.no_memory"), 1u);
  EXPECT_EQ(all.at("refused.garbage"), 2u);
  EXPECT_EQ(all.at("refused.unfinished"), 3u);
  EXPECT_EQ(all.at("refused.no_descriptor"), 0u);
  EXPECT_EQ(all.at("links.overrun"), 4u);
  EXPECT_FALSE(all.contains("refused.unknown"));
}

TEST(CounterNames, RequestsAreListedByOperationAndRefusalsByStatus) {
  RequestCounters counters;
  counters.count(proto::Kind::ns, proto::ns::Resolve::kOperation, proto::Status::done);
  counters.count(proto::Kind::ns, proto::ns::Resolve::kOperation, proto::Status::not_found);
  counters.count(proto::Kind::ns, 0x7fff, proto::Status::not_supported);
  counters.count(proto::Kind::ctrl, proto::ctrl::Statistics::kOperation, proto::Status::done);
  counters.count(proto::Kind::ctrl, proto::ctrl::Hubs::kOperation, proto::Status::done);
  counters.count(proto::Kind::ctrl, proto::ctrl::Kick::kOperation, proto::Status::denied);
  counters.count(proto::Kind::ctrl, proto::ctrl::kRequestsEnd, proto::Status::not_supported);
  counters.count(proto::Kind::ctrl, 0, proto::Status::not_supported);
  const auto all = read(counters);
  EXPECT_EQ(all.at("names.resolve"), 2u);
  EXPECT_EQ(all.at("names.list"), 0u);
  EXPECT_EQ(all.at("names.unknown"), 1u);
  EXPECT_EQ(all.at("names.refused.not_found"), 1u);
  EXPECT_EQ(all.at("names.refused.not_supported"), 1u);
  EXPECT_FALSE(all.contains("names.refused.done"));
  EXPECT_EQ(all.at("names.refused.denied"), 0u);
  EXPECT_EQ(all.at("ctrl.statistics"), 1u);
  EXPECT_EQ(all.at("ctrl.hubs"), 1u);
  EXPECT_EQ(all.at("ctrl.kick"), 1u);
  EXPECT_EQ(all.at("ctrl.reload"), 0u);
  EXPECT_EQ(all.at("ctrl.unknown"), 2u);
  EXPECT_EQ(all.at("ctrl.refused.denied"), 1u);
  EXPECT_EQ(all.at("ctrl.refused.not_supported"), 2u);
}

}  // namespace
}  // namespace gimnet::hub
