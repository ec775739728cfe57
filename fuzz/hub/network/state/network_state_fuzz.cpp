// A hub's routes under any sequence of links, records (of neighbours that lie, too), marks, digests
// and times. Input: a list of choices.

#include <algorithm>
#include <map>
#include <set>
#include <vector>

#include "fuzz/support/fuzz_input.hpp"
#include "hub/network/state/network_state.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::hub;
using std::chrono::milliseconds;

constexpr std::uint32_t kHubs = 6;
constexpr std::uint32_t kLinks = 3;

/// The hubs 1 to 4, and two more that have the ids 1 and 2.
proto::HubKey key_of(std::uint32_t hub) {
  proto::HubKey key;
  key.hub = HubId{static_cast<std::uint16_t>(hub % 4 + 1)};
  key.unique.bytes.back() = static_cast<std::uint8_t>(hub < 4 ? hub + 10 : hub);
  return key;
}

HubIdentity identity_of_choice(fuzz::Choices& choices) {
  const std::uint32_t choice = choices.byte();
  return {key_of(choice % kHubs), proto::HubInstance{choice / kHubs % 3 + 1}, choice >= 128};
}

class Run {
 public:
  explicit Run(std::span<const std::byte> input) : choices_(input) {}

  void all() {
    while (choices_.left()) {
      one();
      look();
    }
    // Once nothing comes any more, its own record is its own.
    for (int second = 0; second < 4; ++second) {
      now_ += std::chrono::seconds(1);
      hub_.advance(now_);
      look();
    }
    const StoredRecord* own = hub_.store().find(hub_.self().key);
    FUZZ_MUST(own != nullptr && own->head()->instance == hub_.self().instance);
    FUZZ_MUST(std::ranges::binary_search(hub_.map().reachable(), hub_.self().key));
  }

 private:
  void one() {
    const LinkNumber link{choices_.below(kLinks) + 1};
    switch (choices_.below(10)) {
      case 0: {
        const auto cost = static_cast<std::uint16_t>(choices_.byte() + 1);
        const auto peer = identity_of_choice(choices_);
        if (hub_.admit(peer).admission != LinkAdmission::accept) break;
        const auto before = peers_.find(link);
        if (before == peers_.end() || before->second != peer.instance) marked_.erase(link);
        peers_.insert_or_assign(link, peer.instance);
        hub_.begin_connection(link, {peer, "a", choices_.below(2) != 0, cost}, now_);
        break;
      }
      case 1:
        hub_.take_mark(link);
        if (peers_.contains(link)) marked_.insert(link);
        break;
      case 2:
        hub_.end_link(link);
        peers_.erase(link);
        marked_.erase(link);
        break;
      case 3:
      case 4:
        hub_.take_record(link, record(), now_);
        break;
      case 5: {
        const auto bytes = choices_.bytes(choices_.byte());
        hub_.take_record(link, {bytes.begin(), bytes.end()}, now_);
        break;
      }
      case 6:
        hub_.take_digest(link, hub_.digest() + choices_.below(2), now_);
        break;
      case 7:
        hub_.set_damped(link, choices_.below(2) != 0);
        hub_.set_cost(link, static_cast<std::uint16_t>(choices_.byte() + 1));
        break;
      case 8:
        leave();
        break;
      default:
        now_ += milliseconds(4 * choices_.byte());
        hub_.advance(now_);
        break;
    }
  }

  proto::Payload record() {
    proto::route::RecordPart part;
    const auto hub = identity_of_choice(choices_);
    part.hub = hub.key;
    part.instance = hub.instance;
    part.configured = hub.configured;
    part.part = static_cast<std::uint16_t>(choices_.below(2));
    part.sequence = choices_.byte();
    if (part.sequence >= 250) part.sequence <<= 32;
    part.behind = proto::HubInstance{choices_.below(2) == 0 ? 0 : kInstance};
    const std::uint32_t who = choices_.byte();
    for (std::uint32_t each = 0; each < kHubs; ++each) {
      if ((who >> each & 1) != 0)
        part.neighbours.push_back({key_of(each), static_cast<std::uint16_t>(each + 1)});
    }
    std::ranges::sort(part.neighbours, {}, &proto::route::Neighbour::hub);
    return proto::encode(part);
  }

  void leave() {
    hub_.leave();
    peers_.clear();
    marked_.clear();
    if (choices_.below(2) != 0) hub_.renumber(hub_.draw_hub_id(choices_.byte()));
  }

  /// After each step.
  void look() {
    for (const Sending& each : hub_.take_sendings()) {
      FUZZ_MUST(peers_.contains(each.link));
      FUZZ_MUST(each.bytes->size() <= proto::route::kPartBytesMax);
      const auto operation = proto::split_control(*each.bytes)->header.operation;
      FUZZ_MUST(operation == proto::route::RecordsEnd::kOperation ||
                read_part(*each.bytes) != nullptr);
    }
    const NetworkMap& map = hub_.map();
    FUZZ_MUST(std::ranges::is_sorted(map.reachable()));
    if (hub_.next_due()) return;  // the map may be behind
    for (const Way& way : map.ways()) {
      FUZZ_MUST(way.link == LinkNumber{} || marked_.contains(way.link));
      FUZZ_MUST(map.next_hops()[way.hub.hub.value()] == way.link);
    }
  }

  static constexpr std::uint64_t kInstance = 1'000;

  fuzz::Choices choices_;
  NetworkState hub_{{key_of(0), proto::HubInstance{kInstance}, false}, {"hub", "1"}};
  milliseconds now_{1'000};
  std::map<LinkNumber, proto::HubInstance> peers_;
  std::set<LinkNumber> marked_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Run(fuzz::input(data, size)).all();
  return 0;
}
