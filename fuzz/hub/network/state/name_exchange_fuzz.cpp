// A hub's names and copies under any sequence of links, messages (of neighbours that lie, too),
// hubs that come and go, own changes and times. Input: a list of choices.

#include <map>
#include <set>
#include <string>
#include <vector>

#include "fuzz/support/fuzz_input.hpp"
#include "hub/network/state/name_exchange.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::hub;
using std::chrono::milliseconds;
namespace route = proto::route;

constexpr std::uint32_t kHubs = 4;
constexpr std::uint32_t kLinks = 3;
constexpr std::uint32_t kNames = 8;
constexpr HubId kSelf{1};

std::string name_of(std::uint32_t choice) { return "robot/" + std::to_string(choice % kNames); }

class Run {
 public:
  explicit Run(std::span<const std::byte> input) : choices_(input) {}

  void all() {
    while (choices_.left()) {
      one();
      look();
    }
    // Hubs that cannot be reached are forgotten in the end, and all names are this hub's own.
    hub_.set_reachable(std::span<const HubRun>{}, now_);
    now_ += std::chrono::minutes(1);
    hub_.advance(now_);
    look();
    FUZZ_MUST(!hub_.next_due() || *hub_.next_due() > now_);
    NodeId last;
    while (const auto known = hub_.copies().node_after(last)) {
      FUZZ_MUST(known->hub == kSelf);
      last = known->claim->node;
    }
  }

 private:
  void one() {
    const LinkNumber link{choices_.below(kLinks) + 1};
    switch (choices_.below(9)) {
      case 0:
        hub_.begin_connection(link, now_);
        links_.insert(link);
        under_way_[link] = 0;
        break;
      case 1:
        hub_.end_link(link);
        links_.erase(link);
        break;
      case 2:
      case 3:
        hub_.take(link, proto::encode(names()), now_);
        break;
      case 4:
        hub_.take(link, proto::encode(known()), now_);
        break;
      case 5: {
        const std::uint32_t taken = choices_.byte();
        hub_.take(link, proto::encode(route::NamesTaken{taken}), now_);
        under_way_[link] -= std::min<std::size_t>(under_way_[link], taken);
        break;
      }
      case 6:
        reach();
        break;
      case 7:
        change_own();
        break;
      default: {
        const auto bytes = choices_.bytes(choices_.byte());
        hub_.take(link, bytes, now_);
        under_way_[link] = 0;  // it may have been NAMES_TAKEN
        now_ += milliseconds(200 * choices_.byte());
        break;
      }
    }
    hub_.advance(now_);
  }

  HubRun run() {
    const std::uint32_t choice = choices_.byte();
    return {HubId{static_cast<std::uint16_t>(choice % kHubs + 1)},
            proto::HubInstance{choice / kHubs % 2 + 1}};
  }

  route::NameClaim claim(HubId hub) {
    route::NameClaim claim;
    const std::uint32_t choice = choices_.byte();
    claim.node = make_id<NodeId>(hub, choice % 4 + 1);
    claim.state = static_cast<route::NameState>(choice / 4 % 3);
    claim.rank = choice / 16 % 2 + proto::route::kOrdinaryRank;
    if (choice >= 192) {
      claim.service.emplace();
      claim.service->group = make_id<GroupId>(hub, choice % 4 + 1);
    }
    if (claim.state == route::NameState::deleted) claim = {0, {}, 1, claim.state, {}};
    return claim;
  }

  route::Names names() {
    const HubRun hub = run();
    route::Names names{hub.hub, hub.instance, choices_.byte(), 0, 0, {}};
    names.version = names.after;
    for (std::uint32_t more = choices_.below(6); more > 0; --more) {
      names.version += choices_.below(3) + 1;
      names.records.push_back({name_of(choices_.byte()), claim(hub.hub)});
      names.records.back().claim.version = names.version;
    }
    names.version += choices_.below(3);
    names.forgotten = choices_.byte() / 2;
    return names;
  }

  route::NamesKnown known() {
    route::NamesKnown known;
    for (std::uint32_t more = choices_.below(4); more > 0; --more) {
      const HubRun hub = run();
      known.hubs.push_back({hub.hub, hub.instance, choices_.byte()});
    }
    return known;
  }

  void reach() {
    std::vector<HubRun> hubs;
    const std::uint32_t who = choices_.byte();
    for (std::uint16_t hub = 2; hub <= kHubs; ++hub) {
      if ((who >> hub & 1) != 0)
        hubs.push_back({HubId{hub}, proto::HubInstance{(who >> (hub + 3) & 1) + 1}});
    }
    hub_.set_reachable(hubs, now_);
  }

  void change_own() {
    const std::string name = name_of(choices_.byte());
    auto mine = claim(kSelf);
    if (mine.state == route::NameState::deleted) {
      hub_.remove_own(name);
    } else {
      hub_.put_own(name, mine);
      FUZZ_MUST(hub_.copies().find(name));
    }
    // A node that lost its name lets go of it.
    for (const KnownName& lost : hub_.take_lost()) {
      FUZZ_MUST(lost.hub != kSelf);
      const std::string text{lost.name};
      hub_.remove_own(text);
      FUZZ_MUST(hub_.copies().find(text)->hub != kSelf);
    }
  }

  /// After each step.
  void look() {
    for (const Sending& each : hub_.take_sendings()) {
      FUZZ_MUST(links_.contains(each.link));
      FUZZ_MUST(each.bytes->size() <= route::kNamesBytesMax);
      const auto operation = proto::split_control(*each.bytes)->header.operation;
      if (operation != route::Names::kOperation) continue;
      const auto names = proto::decode<route::Names>(*each.bytes);
      FUZZ_MUST(names);
      FUZZ_MUST(++under_way_[each.link] <= route::kNamesWindow);
    }
    std::size_t names = 0;
    for (std::uint32_t id = 0; const auto known = hub_.copies().node_after(NodeId{id}); ++names) {
      FUZZ_MUST(known->claim->node.value() > id && !known->claim->service);
      FUZZ_MUST(hub_of(known->claim->node) == known->hub);
      id = known->claim->node.value();
    }
    for (std::uint32_t id = 0; const auto known = hub_.copies().group_after(GroupId{id}); ++names)
      id = known->claim->service->group.value();
    FUZZ_MUST(names == hub_.copies().size());
    (void)hub_.take_changes();
  }

  fuzz::Choices choices_;
  NameExchange hub_{NameCopies::Options{{kSelf, proto::HubInstance{1}}}};
  milliseconds now_{1'000};
  std::set<LinkNumber> links_;
  std::map<LinkNumber, std::size_t> under_way_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Run(fuzz::input(data, size)).all();
  return 0;
}
