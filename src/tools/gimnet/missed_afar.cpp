#include "tools/gimnet/missed_afar.hpp"

#include <algorithm>
#include <unordered_map>

#include "base/ids.hpp"
#include "tools/gimnet/ask_each.hpp"
#include "tools/gimnet/network.hpp"
#include "tools/gimnet/session.hpp"

namespace gimnet::tool {

void add_answer(std::vector<ServiceRecord>& services, std::vector<std::uint64_t>& most,
                std::uint32_t hub_id, const std::vector<ServiceRecord>& told) {
  std::unordered_map<std::uint32_t, const ServiceRecord*> by_group;
  for (const ServiceRecord& each : told) by_group[each.group_id] = &each;
  for (std::size_t i = 0; i < services.size(); ++i) {
    const auto found = by_group.find(services[i].group_id);
    if (found == by_group.end()) continue;
    const ServiceRecord& there = *found->second;
    if (hub_of(GroupId{there.group_id}).value() == hub_id)
      services[i].subscribers = there.subscribers;
    services[i].missed += there.missed;
    if (there.missed <= most[i]) continue;
    most[i] = there.missed;
    services[i].missed_most = there.missed_most;
  }
}

void add_missed_afar(ToolSession& session, std::vector<ServiceRecord>& services) {
  if (services.empty()) return;
  auto hubs = session.node().hubs(kMemberPatience);
  if (!hubs) return say("MISSED is of this hub alone: " + hubs.failure().sentence);
  std::erase_if(*hubs, [](const NetworkHub& hub) { return hub.distance == 0 && hub.reachable; });
  const auto answers = ask_each<MissedAnswer>(*hubs, [&](const NetworkHub& hub) -> MissedAnswer {
    auto told = session.node().hub_missed(kMemberPatience, hub.hub_id);
    if (!told) return {{}, told.failure().sentence};
    return {std::move(*told), ""};
  });
  std::vector<std::uint64_t> most;
  for (const ServiceRecord& each : services) most.push_back(each.missed);
  for (std::size_t i = 0; i < answers.size(); ++i) {
    const NetworkHub& hub = (*hubs)[i];
    if (answers[i].error.empty()) {
      add_answer(services, most, hub.hub_id, answers[i].services);
    } else {
      say("MISSED leaves out hub " + std::to_string(hub.hub_id) + " " + printable(hub.name) + ": " +
          answers[i].error);
    }
  }
}

}  // namespace gimnet::tool
