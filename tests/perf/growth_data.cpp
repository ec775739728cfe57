#include <cstdint>
#include <memory>
#include <vector>

#include "bench/hub/data/support/null_stream.hpp"
#include "tests/hub/data/support/route_rig.hpp"
#include "tests/perf/growth.hpp"

namespace gimnet::hub {

Work retained(std::size_t count) {
  struct World {
    testing::RouteRig rig;
    Run message = rig.make_run(7u << 20 | 1, {"last"}, {.kind = proto::Kind::group});
  };
  auto world = std::make_shared<World>();
  return [world, count] {
    RetainedMessages& kept = world->rig.retained;
    for (std::uint32_t i = 1; i <= count; ++i) {
      proto::FrameHeader header = world->message.header();
      header.dst = make_id<GroupId>(HubId{7}, i).value();
      header.src = make_id<NodeId>(HubId{7}, i).value();
      kept.keep(world->message, header, world->message.size);
    }
    if (kept.groups() != count) wrong("a message was not kept");
    for (std::uint32_t i = 1; i <= count; ++i) kept.forget_provider(make_id<NodeId>(HubId{7}, i));
    if (kept.groups() != 0) wrong("a message outlived its provider's session");
  };
}

Work forwarding(std::size_t count) {
  constexpr std::uint32_t kFirstNode = 2;
  constexpr std::uint32_t kDestinations = 8;
  struct World {
    hub::testing::RouteRig rig;
    benchmarks::NullStream transport;
    std::vector<GatherWriter> writers;
    std::vector<hub::Run> runs;
  };
  const auto nodes = static_cast<std::uint32_t>(count / 80);
  auto world = std::make_shared<World>();
  world->writers = std::vector<GatherWriter>(kFirstNode + nodes);
  for (std::uint32_t i = 0; i < nodes; ++i) world->rig.add_here(kFirstNode + i);
  for (std::uint32_t i = 0; i < kDestinations; ++i) {
    const auto node = make_id<NodeId>(HubId{7}, kFirstNode + i * (nodes / kDestinations)).value();
    world->runs.push_back(world->rig.make_run(node, {"0123456789abcdef"}));
  }
  return [world, count] {
    for (std::size_t i = 1; i <= count; ++i) {
      const hub::Run& run = world->runs[i % kDestinations];
      world->rig.router.route(run.buffer, {run.bytes, run.size, run.frames, run.size});
      if (i % 800 != 0) continue;
      for (Recipient* recipient : world->rig.recipients.dirty()) {
        recipient->dirty = false;
        static_cast<void>(world->writers[recipient->slot.value()].flush(
            recipient->outbox, nullptr, world->transport, world->rig.egress.context));
        recipient->outbox.on_emptied(world->rig.egress.context);
      }
      world->rig.recipients.dirty().clear();
    }
  };
}

}  // namespace gimnet::hub
