#include "tools/demo/labs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "base/clock.hpp"
#include "gimnet/gimi.hpp"
#include "impair/fault_proxy.hpp"
#include "net/address.hpp"
#include "net/wait.hpp"
#include "tools/demo/camera.hpp"
#include "tools/demo/labs_board.hpp"
#include "tools/demo/own_network.hpp"
#include "tools/demo/viewer.hpp"
#include "tools/demo/wan_cuts.hpp"

namespace gimnet::demo {
namespace {

constexpr std::int64_t kReady_ns = 15'000'000'000;
constexpr std::int64_t kArrive_ns = 5'000'000'000;
constexpr std::int64_t kWanDelay_ns = 40'000'000;  ///< each way
constexpr std::int64_t kAskWan_ns = 1'000'000'000;
constexpr Timeout kAsk{1'000};

/// A hub's process, and a node at it that asks about it.
struct LabHub {
  std::string name;
  ChildProcess process;
  HubAddresses at;
  Node node;
};

/// Programs are started and find their files here.
struct LabPaths {
  const std::string& programs;
  const TemporaryFolder& folder;
};

Result<LabHub> start_lab_hub(const LabPaths& paths, const std::string& name, int id,
                             const std::vector<std::string>& more) {
  HubWish wish{"the hub " + name, name, {"--hub-name", name, "--hub-id", std::to_string(id)}};
  wish.more.insert(wish.more.end(), more.begin(), more.end());
  Result<HubProcess> hub = start_hub(paths.programs, paths.folder, wish);
  if (!hub) return hub.error();
  NodeOptions joining;
  joining.hub = hub->at.unix_socket;
  Outcome<Node> node = Node::join(joining);
  if (!node) return Error{node.failure().sentence};
  return LabHub{name, std::move(hub->process), hub->at, std::move(*node)};
}

Result<ChildProcess> start_machine(const LabPaths& paths, const std::string& name,
                                   const LabHub& hub) {
  Result<ChildProcess> process = ChildProcess::start(
      {"the " + name,
       {paths.programs + "/gimnet-demo", "robot", "--hub", hub.at.unix_socket, "--robot", name},
       paths.folder / (name + ".log")});
  if (!process) return process.error();
  if (const Result<std::string> ready = process->read_line(kReady_ns); !ready) return ready.error();
  return process;
}

/// A machine's process, and its driver at a hub.
struct Driven {
  LabsRecord::Machine machine;
  LabsBoard::Lab lab;
  bool crosses_wan;
  ChildProcess process;
  std::unique_ptr<NodePort> port;
  std::unique_ptr<Viewer> viewer;
};

/// A machine of that kind at one hub, and its driver at another one, in words of a record.
struct Wish {
  const char* name;
  const char* kind;
  LabHub& at;
  LabHub& from;
  LabsBoard::Lab lab;
  bool crosses_wan;
};

Result<Driven> start_driven(const LabPaths& paths, const Wish& wish) {
  Result<ChildProcess> process = start_machine(paths, wish.name, wish.at);
  if (!process) return process.error();
  const std::string all = std::string(wish.name) + "/*";
  const auto known = [&] {
    const auto found = wish.from.node.services(all, kAsk);
    return found && found->size() == 4;
  };
  if (!becomes(kReady_ns, known))
    return Error{fmt::format("hub {} does not hear of the {}", wish.from.name, wish.name)};
  Result<std::unique_ptr<NodePort>> port = connect_viewer({wish.from.at.unix_socket, wish.name});
  if (!port) return port.error();
  return Driven{{wish.name, wish.kind, wish.at.name, wish.from.name, Monitor(0), {}},
                wish.lab,
                wish.crosses_wan,
                std::move(*process),
                std::move(*port),
                nullptr};
}

/// The counters of a hub in which nothing moves any more, if that comes.
HubCounters counters_of(LabHub& hub) {
  HubCounters last;
  (void)becomes(kArrive_ns, [&] {
    const auto shards = hub.node.hub_counters(kAsk);
    if (!shards) return false;
    last = {};
    for (const ShardCounts& shard : *shards) {
      for (const auto& [name, value] : shard.counters) last.add(name, value);
    }
    return last.exact() && last.queued == 0;
  });
  return last;
}

/// The two laboratories while they run. Thread safety: the main thread only; its own threads end in
/// run().
class Labs {
 public:
  explicit Labs(const LabsOptions& options) : options_(options) {}

  std::optional<Error> start();
  void run();
  [[nodiscard]] LabsRecord record();

 private:
  std::optional<Error> start_hubs(const LabPaths& paths);
  /// Cuts the WAN, and joins it again, when that is due; the error of a hub that ended.
  std::optional<Error> watch_over();
  void cut_wan(std::int64_t now_ns);
  void measure_wan(std::int64_t now_ns);
  void make_viewer(Driven& driven, bool first);
  [[nodiscard]] StreamRecord::Excuse excuse() {
    return [this](std::int64_t sent_ns) { return cuts_.explain(sent_ns); };
  }

  const LabsOptions& options_;
  std::optional<TemporaryFolder> folder_;
  std::unique_ptr<impair::FaultProxy> wan_;
  std::vector<LabHub> hubs_;  ///< north, south, the rover's
  std::vector<Driven> driven_;
  WanCuts cuts_;
  LabsBoard board_;
  Camera camera_{excuse()};
  std::atomic<bool> over_{false};
  std::int64_t next_ask_ns_ = 0;
};

std::optional<Error> Labs::start_hubs(const LabPaths& paths) {
  hubs_.reserve(3);
  Result<LabHub> north = start_lab_hub(paths, "north", 1, {"--accept-links"});
  if (!north) return north.error();
  impair::Impairment how;
  how.delay_ns = kWanDelay_ns;
  auto wan = impair::FaultProxy::open(*net::parse_address("tcp://127.0.0.1:0", 0),
                                      *net::parse_address(north->at.tcp), how, 1);
  if (!wan) return wan.error();
  wan_ = std::move(*wan);
  const std::string near = north->at.tcp;
  hubs_.push_back(std::move(*north));
  for (const auto& [name, link] : {std::pair{"south", wan_->url()}, {"rover", near}}) {
    const int id = static_cast<int>(hubs_.size()) + 1;
    Result<LabHub> hub = start_lab_hub(paths, name, id, {"--link", link});
    if (!hub) return hub.error();
    hubs_.push_back(std::move(*hub));
  }
  return std::nullopt;
}

std::optional<Error> Labs::start() {
  Result<TemporaryFolder> folder = TemporaryFolder::make();
  if (!folder) return folder.error();
  folder_.emplace(std::move(*folder));
  const LabPaths paths{options_.programs, *folder_};
  if (std::optional<Error> error = start_hubs(paths)) return error;
  LabHub& north = hubs_[0];
  LabHub& south = hubs_[1];
  using Lab = LabsBoard::Lab;
  for (const Wish& wish :
       {Wish{"rover-1", "driven on site", hubs_[2], north, Lab::north, false},
        Wish{"crawler-1", "driven over the WAN", north, south, Lab::north, true},
        Wish{"simulator", "simulated, same services", south, north, Lab::south, true}}) {
    Result<Driven> started = start_driven(paths, wish);
    if (!started) return started.error();
    driven_.push_back(std::move(*started));
  }
  return camera_.open({hubs_[2].at.unix_socket, south.at.unix_socket});
}

void Labs::cut_wan(std::int64_t now_ns) {
  const WanCuts::Change change = cuts_.step(now_ns);
  if (change == WanCuts::Change::none) return;
  const bool cut = change == WanCuts::Change::cut;
  wan_->refuse(cut);
  if (cut) wan_->cut();
  board_.set_round_trip(std::nullopt);
  if (options_.on_progress) options_.on_progress(cut ? "WAN: CUT" : "WAN: back");
}

/// The round trip over the WAN, as the link of the south measures it.
void Labs::measure_wan(std::int64_t now_ns) {
  if (now_ns < next_ask_ns_) return;
  next_ask_ns_ = now_ns + kAskWan_ns;
  const auto links = hubs_[1].node.hub_links(kAsk);
  if (!links) return;
  for (const LinkRecord& link : *links) {
    constexpr std::int64_t kMicrosecond_ns = 1'000;
    if (link.state == "up" && link.rtt_us != 0)
      board_.set_round_trip(std::int64_t{link.rtt_us} * kMicrosecond_ns);
  }
}

std::optional<Error> Labs::watch_over() {
  const std::int64_t now_ns = wall_now_ns();
  cut_wan(now_ns);
  measure_wan(now_ns);
  for (LabHub& hub : hubs_) {
    if (std::optional<Error> error = hub.process.ended()) return error;
  }
  return std::nullopt;
}

void Labs::make_viewer(Driven& driven, bool first) {
  ViewerOptions viewing;
  Terminal* const terminal = first ? options_.terminal : nullptr;
  // The others end when they are told: what a driver says at its end may not be lost in a cut.
  if (first) viewing.seconds = options_.seconds;
  viewing.autopilot = terminal == nullptr;
  viewing.hub_url = "hub " + driven.machine.driven_from;
  viewing.style = options_.style;
  if (driven.crosses_wan) viewing.excuse = excuse();
  const std::size_t place = board_.add(driven.lab, driven.machine.name);
  viewing.on_look = [this, place](const Monitor& heard, std::int64_t now_ns) {
    board_.put(place, now_ns, heard.odometry_stream(), &heard.scan_stream());
  };
  if (first) {
    viewing.trouble = [this](std::int64_t) { return watch_over(); };
    viewing.on_progress = options_.on_progress;
    viewing.labs = [this](std::int64_t now_ns) {
      LabsView view = board_.view();
      cuts_.show(view, now_ns, board_.round_trip_ns());
      return view;
    };
  } else {
    viewing.over = [this] { return over_.load(); };
  }
  driven.viewer = std::make_unique<Viewer>(*driven.port, terminal, std::move(viewing));
}

void Labs::run() {
  for (Driven& each : driven_) make_viewer(each, &each == &driven_.front());
  const std::size_t camera = board_.add(LabsBoard::Lab::south, "camera");
  cuts_.plan(wall_now_ns(), options_.seconds);
  std::vector<std::thread> threads;
  threads.emplace_back([this, camera] {
    camera_.run(over_, [this, camera](const StreamRecord& heard, std::int64_t now_ns) {
      board_.put(camera, now_ns, heard);
    });
  });
  // The end of each of them stands in its record.
  for (std::size_t i = 1; i < driven_.size(); ++i)
    threads.emplace_back([&viewer = *driven_[i].viewer] { static_cast<void>(viewer.run()); });
  static_cast<void>(driven_[0].viewer->run());
  // The others are told to end over a WAN that carries.
  cuts_.stop();
  (void)becomes(kReady_ns, [this] {
    cut_wan(wall_now_ns());
    return cuts_.quiet(wall_now_ns());
  });
  over_.store(true);
  for (std::thread& thread : threads) thread.join();
}

LabsRecord Labs::record() {
  LabsRecord record;
  for (LabHub& hub : hubs_) record.hubs.push_back({hub.name, counters_of(hub)});
  for (Driven& each : driven_) {
    each.machine.monitor = each.viewer->monitor();
    each.machine.run = each.viewer->record();
    // The drops and the ledger of a hub are told once, of the hub.
    each.machine.run.own_hub = false;
    each.machine.monitor.take(HubCounters{});
    record.machines.push_back(each.machine);
  }
  camera_.tell(record);
  record.wan_bytes = wan_->relayed().down_bytes;
  record.cuts = cuts_.count();
  return record;
}

}  // namespace

Result<LabsRecord> run_labs(const LabsOptions& options) {
  Labs labs(options);
  if (std::optional<Error> error = labs.start()) return std::move(*error);
  labs.run();
  return labs.record();
}

}  // namespace gimnet::demo
