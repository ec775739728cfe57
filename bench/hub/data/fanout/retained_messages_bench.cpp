// A session ends, that provided a retained service or none, where many others provide one each:
// what it costs must not grow with those.

#include <benchmark/benchmark.h>

#include "tests/hub/data/support/route_rig.hpp"

namespace gimnet::hub {
namespace {

constexpr std::uint32_t kFirstOther = 10;

class Kept {
 public:
  explicit Kept(std::uint32_t groups)
      : run_(rig_.make_run(7u << 20 | 1, {"last"}, {.kind = proto::Kind::group})) {
    for (std::uint32_t i = 0; i < groups; ++i) keep(kFirstOther + i, kFirstOther + i);
  }
  void keep(std::uint32_t group, std::uint32_t provider) {
    proto::FrameHeader header = run_.header();
    header.dst = make_id<GroupId>(HubId{7}, group).value();
    header.src = make_id<NodeId>(HubId{7}, provider).value();
    rig_.retained.keep(run_, header, run_.size);
  }
  void end_session(std::uint32_t node) {
    rig_.retained.forget_provider(make_id<NodeId>(HubId{7}, node));
  }

 private:
  testing::RouteRig rig_;
  Run run_;
};

void session_without_services_ends(benchmark::State& state) {
  Kept kept(static_cast<std::uint32_t>(state.range(0)));
  for (auto _ : state) kept.end_session(1);
}
BENCHMARK(session_without_services_ends)->Arg(10)->Arg(1'000)->Arg(100'000);

void provider_comes_and_ends(benchmark::State& state) {
  Kept kept(static_cast<std::uint32_t>(state.range(0)));
  for (auto _ : state) {
    kept.keep(1, 1);
    kept.end_session(1);
  }
}
BENCHMARK(provider_comes_and_ends)->Arg(10)->Arg(1'000)->Arg(100'000);

}  // namespace
}  // namespace gimnet::hub
