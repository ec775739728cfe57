#include "tools/demo/labs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "base/clock.hpp"
#include "base/endian.hpp"
#include "gimnet/gimi.hpp"
#include "impair/fault_proxy.hpp"
#include "net/address.hpp"
#include "net/wait.hpp"
#include "tools/demo/own_network.hpp"
#include "tools/demo/viewer.hpp"

namespace gimnet::demo {
namespace {

constexpr std::int64_t kReady_ns = 15'000'000'000;
constexpr std::int64_t kArrive_ns = 5'000'000'000;
constexpr std::int64_t kLook_ns = 20'000'000;
constexpr std::int64_t kWanDelay_ns = 10'000'000;
constexpr std::int64_t kCutEvery_ns = 10'000'000'000;
constexpr Timeout kAsk{1'000};

/// Asks again until it is so. False: it was not within `wait_ns`.
bool becomes(std::int64_t wait_ns, const std::function<bool()>& so) {
  const net::WakeSignal nothing;
  const std::int64_t until_ns = steady_now_ns() + wait_ns;
  while (!so()) {
    if (steady_now_ns() >= until_ns) return false;
    static_cast<void>(net::wait_for(nullptr, {}, nothing, steady_now_ns() + kLook_ns));
  }
  return true;
}

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

/// Pictures of a camera at one hub, for two viewers at another one. Thread safety: open() first,
/// then run() on one thread.
class Camera {
 public:
  static constexpr std::size_t kBytes = 16 * 1024;
  static constexpr std::int64_t kPeriod_ns = 50'000'000;

  std::optional<Error> open(const LabHub& here, const LabHub& there) {
    for (const auto& [hub, name] : {std::pair(&here, "camera"), {&there, ""}, {&there, ""}}) {
      NodeOptions joining;
      joining.hub = hub->at.unix_socket;
      joining.name = name;
      Outcome<Node> node = Node::join(joining);
      if (!node) return Error{node.failure().sentence};
      nodes_.push_back(std::move(*node));
    }
    Outcome<Publisher> eye = nodes_[0].advertise("eye");
    if (!eye) return Error{eye.failure().sentence};
    eye_.emplace(std::move(*eye));
    const auto known = [this] {
      const auto found = nodes_[2].services("camera/eye", kAsk);
      return found && !found->empty();
    };
    if (!becomes(kReady_ns, known)) return Error{"camera/eye is not known at the other hub"};
    for (std::size_t viewer = 1; viewer < nodes_.size(); ++viewer) {
      Outcome<Subscription> pictures = nodes_[viewer].subscribe("camera/eye", {.queue = 1'024});
      if (!pictures) return Error{pictures.failure().sentence};
      viewers_.push_back({std::move(*pictures), 0});
    }
    if (!becomes(kReady_ns, [this] { return eye_->subscribers() > 0; }))
      return Error{"nobody was heard to subscribe to camera/eye"};
    return std::nullopt;
  }

  void run(const std::atomic<bool>& over) {
    Bytes picture(kBytes);
    for (std::int64_t due_ns = steady_now_ns(); !over.load(); due_ns += kPeriod_ns) {
      store_le<std::uint64_t>(picture.data(), sent_ + 1);
      if (eye_->publish(picture, kAsk)) ++sent_;
      (void)becomes(due_ns + kPeriod_ns - steady_now_ns(), [&] { return look() || over.load(); });
    }
    (void)becomes(kArrive_ns, [this] {
      (void)look();
      return std::ranges::all_of(viewers_, [this](const auto& one) { return one.seen == sent_; });
    });
  }

  void tell(LabsRecord& record) const {
    record.pictures = sent_;
    record.picture_bytes = kBytes;
    for (const auto& viewer : viewers_) record.seen.push_back(viewer.seen);
  }

 private:
  /// Takes what has come; false, so that who waits goes on.
  bool look() {
    for (auto& viewer : viewers_) {
      while (const auto message = viewer.pictures.try_receive()) {
        const bool next = message->data().size() == kBytes &&
                          load_le<std::uint64_t>(message->data().data()) == viewer.seen + 1;
        if (next) ++viewer.seen;
      }
    }
    return false;
  }

  struct Watching {
    Subscription pictures;
    std::uint64_t seen;
  };
  std::vector<Node> nodes_;
  std::optional<Publisher> eye_;
  std::vector<Watching> viewers_;
  std::uint64_t sent_ = 0;
};

/// A machine's process, and its driver at a hub.
struct Driven {
  LabsRecord::Machine machine;
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
  /// Cuts the WAN when that is due; the error of a hub that ended.
  std::optional<Error> watch_over();
  void make_viewer(Driven& driven, bool first);

  const LabsOptions& options_;
  std::optional<TemporaryFolder> folder_;
  std::unique_ptr<impair::FaultProxy> wan_;
  std::vector<LabHub> hubs_;  ///< north, south, the rover's
  std::vector<Driven> driven_;
  Camera camera_;
  std::atomic<bool> over_{false};
  std::int64_t next_cut_ns_ = 0;
  std::uint64_t cuts_ = 0;
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
  for (const Wish& wish : {Wish{"rover-1", "driven on site", hubs_[2], north},
                           Wish{"crawler-1", "driven over the WAN", north, south},
                           Wish{"simulator", "simulated, same services", south, north}}) {
    Result<Driven> started = start_driven(paths, wish);
    if (!started) return started.error();
    driven_.push_back(std::move(*started));
  }
  return camera_.open(hubs_[2], south);
}

std::optional<Error> Labs::watch_over() {
  if (steady_now_ns() >= next_cut_ns_ && !over_.load()) {
    wan_->cut();
    ++cuts_;
    next_cut_ns_ += kCutEvery_ns;
  }
  for (LabHub& hub : hubs_) {
    if (std::optional<Error> error = hub.process.ended()) return error;
  }
  return std::nullopt;
}

void Labs::make_viewer(Driven& driven, bool first) {
  ViewerOptions viewing;
  Terminal* const terminal = first ? options_.terminal : nullptr;
  viewing.seconds = options_.seconds;
  viewing.autopilot = terminal == nullptr;
  viewing.hub_url = "hub " + driven.machine.driven_from;
  viewing.style = options_.style;
  if (first) {
    viewing.trouble = [this](std::int64_t) { return watch_over(); };
    viewing.on_progress = options_.on_progress;
  } else {
    viewing.over = [this] { return over_.load(); };
  }
  driven.viewer = std::make_unique<Viewer>(*driven.port, terminal, std::move(viewing));
}

void Labs::run() {
  next_cut_ns_ =
      steady_now_ns() +
      (options_.seconds ? static_cast<std::int64_t>(*options_.seconds * 5e8) : kCutEvery_ns);
  for (Driven& each : driven_) make_viewer(each, &each == &driven_.front());
  std::vector<std::thread> threads;
  threads.emplace_back([this] { camera_.run(over_); });
  // The end of each of them stands in its record.
  for (std::size_t i = 1; i < driven_.size(); ++i)
    threads.emplace_back([&viewer = *driven_[i].viewer] { static_cast<void>(viewer.run()); });
  static_cast<void>(driven_[0].viewer->run());
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
  record.cuts = cuts_;
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
