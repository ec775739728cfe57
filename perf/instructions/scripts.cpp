// Fixed pieces of the hub's work, whose instructions are counted (perf/driver/instructions.py) and
// compared with perf/instructions/budget.json. Under valgrind's callgrind, which counts nothing but
// what runs below counted().
//
//     instruction_scripts SCRIPT    runs it twice, the second time counted; prints the frames
//     instruction_scripts           prints what compiled it, and the names of the scripts

#include <gnu/libc-version.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/endian.hpp"
#include "bench/hub/data/support/null_stream.hpp"
#include "proto/frame/frame_parser.hpp"
#include "tests/hub/data/support/route_rig.hpp"
#include "tests/hub/shard/support/hub_rig.hpp"

extern "C" {
/// Callgrind switches its counting on and off here: never inlined, known by this name.
[[gnu::noinline]] void counted(const std::function<void()>& work) {
  work();
  asm volatile(
      "");  // keeps the call from becoming a jump, which callgrind would not see the end of
}
}

namespace gimnet::hub {
namespace {

constexpr std::uint32_t kDestinations = 8;
constexpr std::uint32_t kFramesPerTurn = 512;
constexpr std::uint32_t kFanOut = 100;
constexpr std::uint32_t kFirstNode = 2;
const char* const kPayload = "0123456789abcdef";

/// Something to be counted, and how many frames it handles.
struct Work {
  std::uint64_t frames;
  std::function<void()> run;
};

std::uint32_t node_id(std::uint32_t index) { return make_id<NodeId>(HubId{7}, index).value(); }

/// Frames of 16 bytes; `destinations` take turns.
std::vector<std::byte> frames_to(std::uint32_t destinations) {
  std::vector<std::byte> bytes(kFramesPerTurn * (proto::kHeaderSize + std::strlen(kPayload)));
  std::byte* at = bytes.data();
  for (std::uint32_t i = 0; i < kFramesPerTurn; ++i) {
    proto::FrameHeader header;
    header.length = static_cast<std::uint32_t>(std::strlen(kPayload));
    header.dst = node_id(kFirstNode + i % destinations);
    header.src = node_id(1);
    header.lane = 1;
    proto::store_header(at, header);
    std::memcpy(at + proto::kHeaderSize, kPayload, header.length);
    at += header.frame_size();
  }
  return bytes;
}

Work parser(std::uint32_t destinations) {
  return {kFramesPerTurn, [bytes = frames_to(destinations)] {
            const std::byte* at = bytes.data();
            const std::byte* const end = at + bytes.size();
            while (at != end) {
              const proto::NextRun next = proto::next_run(at, end, proto::kFrameLengthDefault);
              const auto error = proto::check_header_from_node(proto::load_header(next.run.bytes));
              if (next.found != proto::Found::run || error != proto::FrameError::none) std::abort();
              at += next.run.size;
            }
          }};
}

/// A shard's routing side with recipients that take everything at once.
struct Routing {
  testing::RouteRig rig;
  benchmarks::NullStream transport;
  std::vector<GatherWriter> writers;
  std::vector<hub::Run> runs;

  explicit Routing(std::uint32_t nodes) : writers(kFirstNode + nodes) {
    for (std::uint32_t i = 0; i < nodes; ++i) rig.add_here(kFirstNode + i);
  }
  void flush() {
    for (Recipient* recipient : rig.recipients.dirty()) {
      recipient->dirty = false;
      GatherWriter& writer = writers[recipient->slot.value()];
      static_cast<void>(writer.flush(recipient->outbox, nullptr, transport, rig.egress.context));
      recipient->outbox.on_emptied(rig.egress.context);
    }
    rig.recipients.dirty().clear();
  }
};

/// A hub with so many nodes; what it costs must not depend on that.
Work router(std::uint32_t nodes) {
  auto routing = std::make_shared<Routing>(nodes);
  for (std::uint32_t i = 0; i < kDestinations; ++i) {
    const std::uint32_t index = kFirstNode + i * (nodes / kDestinations);
    routing->runs.push_back(routing->rig.make_run(node_id(index), {kPayload}));
  }
  return {kFramesPerTurn, [routing] {
            for (std::uint32_t i = 0; i < kFramesPerTurn; ++i) {
              const hub::Run& run = routing->runs[i % kDestinations];
              // As the reader does it.
              routing->rig.router.route(run.buffer, {run.bytes, run.size, run.frames, run.size});
            }
            routing->flush();
          }};
}

Work outbox() {
  auto routing = std::make_shared<Routing>(1);
  routing->runs.push_back(routing->rig.make_run(node_id(kFirstNode), {kPayload}));
  return {kFramesPerTurn, [routing] {
            Outbox& outbox = routing->rig.recipients_made.front()->outbox;
            const hub::Run& run = routing->runs.front();
            const proto::FrameHeader header = run.header();
            for (std::uint32_t i = 0; i < kFramesPerTurn; ++i) {
              outbox.push(run, header, {}, routing->rig.egress.context);
              static_cast<void>(routing->writers.front().flush(outbox, nullptr, routing->transport,
                                                               routing->rig.egress.context));
              outbox.on_emptied(routing->rig.egress.context);
            }
          }};
}

Work fan_out() {
  auto routing = std::make_shared<Routing>(kFanOut);
  routing->runs.push_back(
      routing->rig.make_run(node_id(1), {kPayload}, {.kind = proto::Kind::group}));
  constexpr std::uint32_t kFrames = 8;
  return {kFrames * kFanOut, [routing] {
            const hub::Run& run = routing->runs.front();
            const proto::FrameHeader header = run.header();
            for (std::uint32_t i = 0; i < kFrames; ++i) {
              for (const auto& recipient : routing->rig.recipients_made) {
                routing->rig.fanout.deliver(*recipient, run, header, Handover{true});
              }
            }
            routing->flush();
          }};
}

Work mailbox() {
  struct Doors {
    Waker waker;
    Mailbox mailbox{2, {.entries = 8'192, .bytes = 16u << 20}, waker};
  };
  return {kFramesPerTurn, [doors = std::make_shared<Doors>()] {
            Mail mail;
            mail.size = 32;
            mail.frames = 1;
            std::uint64_t frames = 0;
            for (std::uint32_t i = 0; i < kFramesPerTurn; ++i)
              doors->mailbox.post(ShardIndex{1}, mail);
            doors->mailbox.drain(10'000, [] {}, [&](const Mail& taken) { frames += taken.frames; });
            if (frames != kFramesPerTurn) std::abort();
          }};
}

/// A turn of a shard that reads what a node wrote. A type of its own: the name of a lambda would
/// have those of the test rig in it, whose work is not counted.
struct Turn {
  std::shared_ptr<testing::HubRig> rig;
  testing::FakeNode* sender;
  std::vector<std::byte> bytes;

  void operator()() const {
    rig->write(*sender, bytes);
    rig->shard(0).turn(rig->ready(0), ++rig->now_ms);
  }
};

Work turn_of(std::uint64_t frames, const std::shared_ptr<testing::HubRig>& rig,
             testing::FakeNode& sender, const std::vector<std::byte>& bytes) {
  return {frames, Turn{rig, &sender, bytes}};
}

std::vector<testing::FakeNode*> join_members(testing::HubRig& rig) {
  std::vector<testing::FakeNode*> members;
  for (std::uint32_t i = 0; i < kFanOut; ++i) members.push_back(&rig.join(0));
  return members;
}

/// So many frames in a row; `frame_of` makes the one of a number.
template <class FrameOf>
std::vector<std::byte> in_a_row(std::uint32_t frames, const FrameOf& frame_of) {
  std::vector<std::byte> bytes;
  for (std::uint32_t i = 0; i < frames; ++i) {
    const auto frame = frame_of(i);
    bytes.insert(bytes.end(), frame.begin(), frame.end());
  }
  return bytes;
}

Work hub_turn(std::uint32_t destinations) {
  auto rig = std::make_shared<testing::HubRig>();
  testing::FakeNode& sender = rig->join(0);
  for (std::uint32_t i = 0; i < destinations; ++i) rig->join(0);
  rig->settle();
  const auto frame_of = [&](std::uint32_t i) {
    return testing::HubRig::frame(sender, sender.id.value() + 1 + i % destinations, kPayload);
  };
  return turn_of(kFramesPerTurn, rig, sender, in_a_row(kFramesPerTurn, frame_of));
}

/// Turns of one frame each: what a turn costs beside its frames, which is what a round trip feels.
Work hub_turn_single() {
  auto rig = std::make_shared<testing::HubRig>();
  testing::FakeNode& sender = rig->join(0);
  testing::FakeNode& receiver = rig->join(0);
  rig->settle();
  constexpr std::uint32_t kTurns = 64;
  return {kTurns,
          [rig, &sender, bytes = testing::HubRig::frame(sender, receiver.id.value(), kPayload)] {
            for (std::uint32_t i = 0; i < kTurns; ++i) {
              rig->write(sender, bytes);
              const Ready ready{.token = rig->connection(sender)->token(), .readable = true};
              rig->shard(0).turn({&ready, 1}, rig->now_ms);
            }
          }};
}

/// A provider with so many services, each with the same members, whose frames come in turns.
Work hub_turn_fan_out(std::uint32_t services) {
  auto rig = std::make_shared<testing::HubRig>();
  testing::FakeNode& provider = rig->join(0);
  const auto members = join_members(*rig);
  for (std::uint32_t service = 1; service <= services; ++service)
    rig->publish_group(service, provider.id, members);
  rig->settle();
  constexpr std::uint32_t kFrames = 32;
  const auto frame_of = [&](std::uint32_t i) {
    return testing::HubRig::frame(provider, testing::HubRig::group(1 + i % services), kPayload,
                                  {.kind = proto::Kind::group});
  };
  return turn_of(kFrames * kFanOut, rig, provider, in_a_row(kFrames, frame_of));
}

/// A long run to members whose queues are full: for each of them as many messages go as come.
Work hub_turn_full() {
  Limits limits;
  limits.lane1_bytes = 40'000;
  auto rig = std::make_shared<testing::HubRig>(1, limits);
  testing::FakeNode& provider = rig->join(0);
  const auto members = join_members(*rig);
  rig->publish_group(1, provider.id, members);
  rig->settle();
  for (testing::FakeNode* member : members) member->pipe.set_room(0);
  const auto frame = testing::HubRig::frame(provider, testing::HubRig::group(1), kPayload,
                                            {.kind = proto::Kind::group});
  const auto bytes = in_a_row(kFramesPerTurn, [&](std::uint32_t) { return frame; });
  Work work = turn_of(kFramesPerTurn * kFanOut, rig, provider, bytes);
  for (int i = 0; i < 8; ++i) work.run();
  return work;
}

/// The same to recipients by their ids: each frame brings its own.
Work hub_turn_list() {
  auto rig = std::make_shared<testing::HubRig>();
  testing::FakeNode& sender = rig->join(0);
  std::string ids_and_payload;
  for (std::uint32_t i = 0; i < kFanOut; ++i) {
    std::array<std::byte, 4> id{};
    store_le(id.data(), rig->join(0).id.value());
    ids_and_payload.append(reinterpret_cast<const char*>(id.data()), id.size());
  }
  ids_and_payload += kPayload;
  rig->settle();
  constexpr std::uint32_t kFrames = 32;
  const auto frame =
      testing::HubRig::frame(sender, kFanOut, ids_and_payload, {.kind = proto::Kind::list});
  const auto bytes = in_a_row(kFrames, [&](std::uint32_t) { return frame; });
  return turn_of(kFrames * kFanOut, rig, sender, bytes);
}

struct Script {
  const char* name;
  Work (*make)();
};

constexpr Script kScripts[] = {
    {"parser_run", [] { return parser(1); }},
    {"parser_in_turns", [] { return parser(kDestinations); }},
    {"router_in_turns", [] { return router(kDestinations); }},
    {"router_of_10000_nodes", [] { return router(10'000); }},
    {"outbox", outbox},
    {"fan_out_100", fan_out},
    {"mailbox", mailbox},
    {"hub_turn_one_to_one", [] { return hub_turn(1); }},
    {"hub_turn_in_turns", [] { return hub_turn(kDestinations); }},
    {"hub_turn_fan_out_100", [] { return hub_turn_fan_out(1); }},
    {"hub_turn_fan_out_100_in_turns", [] { return hub_turn_fan_out(kDestinations); }},
    {"hub_turn_full_100", hub_turn_full},
    {"hub_turn_list_100", hub_turn_list},
    {"hub_turn_single", hub_turn_single},
};

}  // namespace
}  // namespace gimnet::hub

int main(int argc, char** argv) {
  if (argc < 2) {
#if defined(__OPTIMIZE__) && defined(NDEBUG)
    const char* const build = "release";
#else
    const char* const build = "other";
#endif
    std::printf("%s %s %s glibc-%s\n", __VERSION__, GIMNET_PROCESSOR, build,
                ::gnu_get_libc_version());
    for (const auto& script : gimnet::hub::kScripts) std::puts(script.name);
    return 0;
  }
  for (const auto& script : gimnet::hub::kScripts) {
    if (std::strcmp(argv[1], script.name) != 0) continue;
    const auto work = script.make();
    work.run();
    counted(work.run);
    std::printf("%llu\n", static_cast<unsigned long long>(work.frames));
    return 0;
  }
  std::fprintf(stderr, "instruction_scripts: there is no script '%s'\n", argv[1]);
  return 1;
}
