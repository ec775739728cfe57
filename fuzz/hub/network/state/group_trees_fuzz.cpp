// A hub's joined groups under any sequence of links, messages (of neighbours that lie, too), routes
// and own wishes. Input: a list of choices.

#include <map>
#include <set>
#include <vector>

#include "fuzz/support/fuzz_input.hpp"
#include "hub/network/state/group_trees.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::hub;
namespace route = proto::route;

constexpr std::uint32_t kLinks = 3;
constexpr HubId kSelf{1};

class Run {
 public:
  explicit Run(std::span<const std::byte> input) : choices_(input) {}

  void all() {
    while (choices_.left()) {
      one();
      say();
      look();
    }
    for (std::uint32_t link = 1; link <= kLinks; ++link) end(LinkNumber{link});
    for (std::uint32_t choice = 0; choice < kGroups; ++choice) {
      if (hub_of(group(choice)) != kSelf) trees_.want(group(choice), std::nullopt);
    }
    own_.clear();
    say();
    FUZZ_MUST(trees_.size() == 0);
  }

 private:
  static constexpr std::uint32_t kGroups = 6;

  /// Of hubs 1 to 3, two of each.
  static GroupId group(std::uint32_t choice) {
    const HubId hub{static_cast<std::uint16_t>(choice % 3 + 1)};
    return make_id<GroupId>(hub, choice / 3 % 2 + 1);
  }
  JoinTerms terms() {
    return {choices_.below(3) * 1'000, static_cast<std::uint16_t>(choices_.below(2) + 1),
            static_cast<std::uint16_t>(choices_.below(3))};
  }

  /// Some are as large as they can be. No choice: the seeds mean what they meant.
  std::uint32_t number() { return ++numbers_ % 7 == 0 ? UINT32_MAX - 1 : numbers_ % 5 + 1; }

  void one() {
    now_ += std::chrono::milliseconds{30};
    const LinkNumber link{choices_.below(kLinks) + 1};
    const GroupId wanted = group(choices_.byte());
    switch (choices_.below(8)) {
      case 0:
        trees_.begin_connection(link);
        joined_[link].clear();
        break;
      case 1:
        end(link);
        break;
      case 2:
        trees_.take(link, route::Join{{{wanted, terms(), number()}}, choices_.below(2) != 0});
        break;
      case 3:
        trees_.take(link, route::Leave{{wanted}});
        break;
      case 4:
        trees_.take(link, route::JoinsEnd{});
        break;
      case 5:
        trees_.take(link, route::Joined{{wanted}});
        break;
      case 6:
        if (hub_of(wanted) == kSelf) break;
        own_.erase(wanted);
        if (choices_.below(3) != 0) own_[wanted] = {terms(), number()};
        trees_.want(wanted, own_.contains(wanted) ? std::optional{own_[wanted]} : std::nullopt);
        break;
      default: {
        std::array<LinkNumber, NetworkMap::kHubIds> next_hops{};
        next_hops[2] = LinkNumber{choices_.below(kLinks + 1)};
        next_hops[3] = LinkNumber{choices_.below(kLinks + 1)};
        trees_.set_next_hops(next_hops);
        break;
      }
    }
  }
  void end(LinkNumber link) {
    trees_.end_link(link);
    joined_[link].clear();
    said_[link].clear();
  }
  /// The other sides keep what they are told.
  void say() {
    static_cast<void>(trees_.take_changed());
    static_cast<void>(trees_.take_recounted());
    for (const Sending& each : trees_.take_sendings(now_)) {
      std::set<GroupId>& joined = joined_[each.link];
      if (const auto join = proto::decode<route::Join>(*each.bytes)) {
        for (const auto& entry : join->groups) {
          FUZZ_MUST(joined.insert(entry.group).second == join->anew);
          said_[each.link][entry.group] = entry.subscribers;
        }
      } else if (const auto leave = proto::decode<route::Leave>(*each.bytes)) {
        for (const GroupId left : leave->groups) FUZZ_MUST(joined.erase(left) == 1);
      } else if (const auto answer = proto::decode<route::Joined>(*each.bytes)) {
        for (const GroupId answered : answer->groups)
          FUZZ_MUST(trees_.branches(answered)->contains(each.link));
      } else {
        FUZZ_MUST(proto::decode<route::JoinsEnd>(*each.bytes));
      }
    }
    FUZZ_MUST(trees_.take_sendings(now_).empty());
  }
  /// The subscribers here, and behind all links but that one.
  std::uint32_t subscribers(GroupId group, LinkNumber parent) const {
    std::uint64_t sum = own_.contains(group) ? own_.at(group).subscribers : 0;
    for (const auto& [link, branch] : *trees_.branches(group))
      if (link != parent) sum += branch.subscribers;
    return static_cast<std::uint32_t>(std::min<std::uint64_t>(sum, UINT32_MAX));
  }
  /// Each group is joined at its parent, and nowhere else. Numbers that were said are right, or
  /// there are some to be said.
  void look() {
    for (std::uint32_t choice = 0; choice < kGroups; ++choice) {
      for (std::uint32_t link = 1; link <= kLinks; ++link) {
        const bool there = joined_[LinkNumber{link}].contains(group(choice));
        FUZZ_MUST(there == (trees_.parent(group(choice)) == LinkNumber{link}));
        if (!there) continue;
        const LinkNumber parent{link};
        const bool right = said_[parent][group(choice)] == subscribers(group(choice), parent);
        FUZZ_MUST(right || (trees_.next_due() && *trees_.next_due() > now_));
      }
    }
  }

  fuzz::Choices choices_;
  GroupTrees trees_{kSelf};
  std::map<LinkNumber, std::set<GroupId>> joined_;
  std::map<LinkNumber, std::map<GroupId, std::uint32_t>> said_;
  std::map<GroupId, JoinWish> own_;
  std::chrono::milliseconds now_{0};
  std::uint32_t numbers_ = 0;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Run(fuzz::input(data, size)).all();
  return 0;
}
