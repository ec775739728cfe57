#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "hub/control/hub_link.hpp"
#include "hub/shard/commands.hpp"

namespace gimnet::hub {

/// The links of a hub, by number, by the session of their place, and by name. Thread safety: the
/// conductor's thread only. Ownership: of the links. Limits: as of Links.
class LinkRoster {
 public:
  using All = std::map<LinkNumber, std::unique_ptr<HubLink>>;
  /// Of links that the other side gave up the latest are shown.
  static constexpr std::size_t kEndedMost = 64;

  [[nodiscard]] const All& all() const { return links_; }
  // Null: there is none.
  [[nodiscard]] HubLink* find(LinkNumber number) const;
  [[nodiscard]] HubLink* find(const SessionRef& session) const;
  /// Dialled links go first: the other side chose the names of accepted ones. These are found as
  /// `from hub N`, too, as `gimnet links` shows them.
  [[nodiscard]] HubLink* find(std::string_view name) const;
  /// The one that the hub with that unique id dialled under that name.
  [[nodiscard]] HubLink* find_accepted(const proto::UniqueId& dialler, std::string_view name) const;

  /// The dialled link of that name, or why none can be changed.
  [[nodiscard]] Result<HubLink*> to_change(std::string_view name) const;

  HubLink& add(DialledLink dialled);
  /// One that the other side dialled.
  HubLink& add_accepted(std::string_view name);
  void give_place(HubLink& link, Place place);
  /// REQUIRES: it has one.
  [[nodiscard]] Place take_place(HubLink& link);
  /// REQUIRES: it has no place.
  void forget(LinkNumber number) { links_.erase(number); }
  /// Those that ended so long ago that they are shown no more.
  [[nodiscard]] std::vector<LinkNumber> long_ended(std::chrono::milliseconds now) const;

 private:
  All links_;
  std::map<std::uint32_t, LinkNumber> by_generation_;  ///< of those with a place
  std::uint32_t last_number_ = 0;
};

}  // namespace gimnet::hub
