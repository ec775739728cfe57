#include "hub/hub.hpp"

#include <algorithm>
#include <cstring>
#include <vector>

#include "base/clock.hpp"
#include "base/log.hpp"
#include "base/random.hpp"
#include "hub/config/folders.hpp"
#include "hub/config/sources.hpp"
#include "hub/config/state_folder.hpp"
#include "hub/control/conductor.hpp"
#include "hub/control/conductor_loop.hpp"
#include "hub/shard/io_shard.hpp"
#include "hub/version.hpp"

namespace gimnet::hub {
namespace {

// A reader of STATISTICS takes sums for numbers with a sign.
static_assert(kGapFramesMost <= std::uint64_t{INT64_MAX} / kShardsMax);
static_assert(kShardCountMax <=
              kShardsMax);  // as many as the tables and sets of shards have room for

/// Nobody asked for the default socket: a place for it that cannot be used, as in the environment
/// of a session that has ended, costs that socket and not the hub.
std::vector<ListenUrl> addresses_for(const HubOptions& options) {
  if (!options.listen.empty()) return options.listen;
  const Result<std::string> folder = runtime_folder();
  std::string trouble = folder ? "" : folder.error().sentence;
  std::vector<ListenUrl> urls;
  for (const std::string& text : default_addresses()) {
    const Result<ListenUrl> url = parse_listen_url(text);
    if (!url) {
      trouble = url.error().sentence;
    } else if (folder || url->scheme == ListenUrl::Scheme::tcp) {
      urls.push_back(*url);
    }
  }
  if (!trouble.empty()) {
    log_warning(
        "listening on TCP only, without the Unix socket over which administrators connect: " +
        trouble + "; --listen unix:/PATH names another place, beside --listen " +
        urls.front().text());
  }
  return urls;
}

/// The conductor's door to the real shards.
class Shards final : public ShardProxy {
 public:
  Shards(const HubShared& shared, IoShard::Options options) {
    for (std::size_t i = 0; i < shared.mailboxes.size(); ++i) {
      shards_.push_back(
          std::make_unique<IoShard>(ShardIndex{static_cast<std::uint8_t>(i)}, shared, options));
    }
  }
  ~Shards() override { stop(); }
  Shards(const Shards&) = delete;
  Shards& operator=(const Shards&) = delete;

  void start() {
    for (const auto& shard : shards_) shard->start();
    running_ = true;
  }
  void stop() {
    if (!running_) return;
    running_ = false;
    for (const auto& shard : shards_) shard->send(StopCommand{});
    for (const auto& shard : shards_) shard->join();
    for (const auto& shard : shards_) shard->let_go();
  }
  void send(ShardIndex shard, ShardCommand command) override {
    shards_[shard.value()]->send(std::move(command));
  }
  [[nodiscard]] std::size_t shards() const override { return shards_.size(); }

 private:
  std::vector<std::unique_ptr<IoShard>> shards_;
  bool running_ = false;
};

/// The parts that the shards share, and their owner.
struct SharedParts {
  explicit SharedParts(const HubOptions& options)
      : quiescence(options.shards),
        budget(options.limits.budget_bytes, options.shards),
        link_budget(options.limits.link_budget_bytes, options.shards),
        retained_budget(options.limits.retained_budget_bytes),
        inbox(options.shards) {
    // As many as a reload may allow: what is not used costs nothing.
    const std::uint64_t nodes_most =
        find_limit("nodes")->most + find_limit("administrators")->most + Links::kLinksMax;
    for (std::size_t i = 0; i < options.shards; ++i) {
      wakers.push_back(std::make_unique<Waker>());
      mailboxes.push_back(std::make_unique<Mailbox>(
          options.shards, Mailbox::bounds_from(options.limits), *wakers.back()));
      counters.push_back(std::make_unique<ShardCounters>());
      readable.push_back(counters.back().get());
      sessions.push_back(std::make_unique<SessionGauges>(nodes_most));
      readable_sessions.push_back(sessions.back().get());
    }
  }

  [[nodiscard]] HubShared shared(const HubOptions& options) {
    HubShared result{.hub = options.id,
                     .limits = options.limits,
                     .nodes = nodes,
                     .groups = groups,
                     .routes = routes,
                     .quiescence = quiescence,
                     .budget = budget,
                     .link_budget = link_budget,
                     .retained_budget = retained_budget,
                     .inbox = inbox,
                     .mailboxes = {},
                     .wakers = {},
                     .counters = {},
                     .sessions = {}};
    for (const auto& mailbox : mailboxes) result.mailboxes.push_back(mailbox.get());
    for (const auto& waker : wakers) result.wakers.push_back(waker.get());
    for (const auto& counter : counters) result.counters.push_back(counter.get());
    for (const auto& gauges : sessions) result.sessions.push_back(gauges.get());
    return result;
  }

  NodeTable nodes;
  GroupTable groups;
  RouteTable routes;
  Quiescence quiescence;
  Budget budget;
  Budget link_budget;
  Budget retained_budget;
  ControlInbox inbox;
  std::vector<std::unique_ptr<Waker>> wakers;
  std::vector<std::unique_ptr<Mailbox>> mailboxes;
  std::vector<std::unique_ptr<ShardCounters>> counters;
  std::vector<std::unique_ptr<SessionGauges>> sessions;
  std::vector<const ShardCounters*> readable;
  RefusalCounters refusals;
  std::vector<const SessionGauges*> readable_sessions;
};

/// As configured, with the links to dial now, and the hub id that it drew where none is.
HubOptions identified(HubOptions options, std::vector<DialledLink> dial, const HubState& state) {
  options.links.dial = std::move(dial);
  if (!options.id_configured && state.drawn_hub != kOwnHub) options.id = state.drawn_hub;
  return options;
}

HubFacts facts_of(const HubOptions& options, const StartState& from, bool redrawn) {
  HubFacts facts;
  facts.id = options.id;
  facts.id_configured = options.id_configured;
  facts.redrawn = redrawn;
  std::memcpy(facts.unique.bytes.data(), from.start.state.unique_id.data(),
              facts.unique.bytes.size());
  facts.instance = from.instance;
  facts.insecure = options.insecure;
  facts.name = options.shown_name();
  facts.version = kVersion;
  facts.shards = options.shards;
  facts.started = std::chrono::milliseconds{steady_now_ns() / 1'000'000};
  return facts;
}

}  // namespace

/// In the order in which they need each other: shards end before the conductor frees what they look
/// at.
struct Hub::Parts {
  /// `given`: as configured. `former`: the hub that it succeeds.
  Parts(const HubOptions& given, const std::optional<Succession>& former,
        const ConfigSources& sources, StartState from,
        std::vector<std::unique_ptr<Listener>> listeners)
      : options(identified(given, former ? former->links : given.links.dial, from.start.state)),
        reloader(sources, given),
        limits(given.limits),
        state_folder(std::move(from.folder)),
        ground(options),
        shared(ground.shared(options)),
        shards(shared, {.spin = options.spin}),
        conductor(facts_of(options, from, former.has_value()), options.placement, limits,
                  Conductor::Wiring{shards,
                                    {ground.nodes, ground.groups, ground.quiescence},
                                    ground.readable,
                                    from.start,
                                    keep_state(),
                                    ground.readable_sessions,
                                    &ground.refusals,
                                    [this] { return reloader.read_again(); },
                                    [this](LogLevel level) { reloader.note_log_level(level); },
                                    network()}) {
    for (const auto& listener : listeners) {
      addresses += (addresses.empty() ? "" : " ") + listener->url().text();
      listen.push_back(listener->url());
    }
    loop = std::make_unique<ConductorLoop>(
        ConductorLoop::Wiring{conductor, ground.inbox, limits, ground.refusals, dialler},
        std::move(listeners));
  }

  Conductor::Wiring::Network network() {
    const auto dial = [this](LinkNumber link, const DialledLink& to, const proto::Hello& hello) {
      dialler.dial(link, to, hello,
                   {.send_bytes = static_cast<std::uint32_t>(limits.socket_send_bytes)});
    };
    return {ground.routes, options.links, dial, wall_now_ns, random_bits};
  }

  StateKeeper::Keep keep_state() {
    if (state_folder == nullptr) return {};
    return [this](const HubState& state) { return state_folder->write(state); };
  }

  const HubOptions options;
  Reloader reloader;
  Limits limits;  ///< the conductor's; each shard has its own
  const std::unique_ptr<StateFolder> state_folder;
  SharedParts ground;
  const HubShared shared;
  Shards shards;
  LinkDialler dialler;
  Conductor conductor;
  std::string addresses;
  std::vector<ListenUrl> listen;
  std::unique_ptr<ConductorLoop> loop;
};

Hub::Hub(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

Hub::~Hub() { parts_->shards.stop(); }

Result<std::unique_ptr<Hub>> Hub::start(const HubOptions& options, const ConfigSources& sources,
                                        const std::optional<Succession>& former) {
  const std::vector<ListenUrl> asked_for = addresses_for(options);
  const std::vector<ListenUrl>& urls = former ? former->listen : asked_for;
  std::vector<std::unique_ptr<Listener>> listeners;
  for (const ListenUrl& url : urls) {
    Result<std::unique_ptr<Listener>> listener = Listener::open(url, listeners);
    if (!listener) return listener.error();
    listeners.push_back(std::move(*listener));
  }
  for (const auto& listener : listeners) {
    if (listener->url().is_local()) continue;
    log_warning("listening on " + listener->url().text() +
                ": other machines can reach it, nothing is encrypted, and whoever connects is let "
                "in (insecure = true; docs/operations.md, 'Crossing a network')");
  }
  // After the addresses: a second hub by mistake is told that they are in use, which says more.
  const std::chrono::milliseconds wall{wall_now_ns() / 1'000'000};
  Result<StartState> state =
      start_state({.folder = options.state_dir,
                   .draws_hub = !options.id_configured && !options.links.dial.empty(),
                   .drawn = former ? former->id : kOwnHub,
                   .address = asked_for.front(),
                   .wall = wall});
  if (!state) return state.error();
  std::unique_ptr<Hub> hub(new Hub(
      std::make_unique<Parts>(options, former, sources, std::move(*state), std::move(listeners))));
  hub->parts_->shards.start();
  return hub;
}

std::string Hub::addresses() const { return parts_->addresses; }

std::optional<Hub::Succession> Hub::run() {
  parts_->loop->run();
  parts_->shards.stop();
  const std::optional<HubId> redrawn = parts_->conductor.redrawn();
  if (!redrawn) return std::nullopt;
  log_info("hub id " + std::to_string(parts_->options.id.value()) +
           " is another hub's: this hub begins anew as hub " + std::to_string(redrawn->value()) +
           "; hub_id = N sets one");
  Succession successor{*redrawn, parts_->listen, {}};
  for (const auto& [number, link] : parts_->conductor.links()->all()) {
    if (link->is_dialled()) successor.links.push_back(link->dialled());
  }
  return successor;
}

}  // namespace gimnet::hub
