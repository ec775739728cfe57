#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hub/control/group_links.hpp"
#include "hub/control/hub_facts.hpp"
#include "hub/control/links.hpp"
#include "hub/control/network_names.hpp"
#include "hub/control/network_view.hpp"
#include "hub/observe/session_gauges.hpp"

namespace gimnet::hub {

/// The network as a hub with links shows it. Thread safety: the conductor's thread only. Lifetime:
/// its parts outlive it.
class NetworkOverview final : public NetworkView {
 public:
  struct Parts {
    const HubFacts& facts;
    Links& links;
    const NetworkNames& names;
    const GroupLinks& groups;
    std::span<const SessionGauges* const> sessions;  ///< one per shard, or none
  };
  explicit NetworkOverview(const Parts& parts) : parts_(parts) {}

  [[nodiscard]] std::vector<HubView> hubs() const override;
  [[nodiscard]] std::vector<LinkView> links() const override;
  [[nodiscard]] std::vector<Count> not_taken() const override;
  [[nodiscard]] std::string add_link(const DialledLink& link) override {
    return parts_.links.add(link);
  }
  [[nodiscard]] std::string remove_link(std::string_view name) override {
    return parts_.links.remove(name);
  }
  [[nodiscard]] std::string set_link_cost(std::string_view name, std::uint16_t cost) override {
    return parts_.links.set_cost(name, cost);
  }

 private:
  [[nodiscard]] bool is_unmeasured(LinkNumber number) const;
  void hide_unmeasured(std::vector<HubView::Edge>& own) const;
  [[nodiscard]] LinkView view_of(const HubLink& link) const;
  [[nodiscard]] proto::ctrl::LinkState state_of(const HubLink& link) const;

  const Parts parts_;
};

}  // namespace gimnet::hub
