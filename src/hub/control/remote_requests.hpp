#pragma once

#include <chrono>
#include <compare>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "base/ids.hpp"
#include "base/token_bucket.hpp"
#include "hub/control/hub_facts.hpp"
#include "hub/control/links.hpp"
#include "hub/control/moving_nodes.hpp"
#include "hub/control/shard_proxy.hpp"
#include "hub/shard/commands.hpp"
#include "proto/control/control_message.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {

/// Requests that cross links, and their answers: sends on those of this hub's nodes, passes on
/// those of others, and sees to it that each of this hub's nodes gets one answer, from this hub if
/// the other one is silent. Thread safety: the conductor's thread only. Limits: the unanswered
/// requests of a node; kRate for requests from one link.
class RemoteRequests {
 public:
  static constexpr std::chrono::milliseconds kAnswerTime = std::chrono::seconds(5);
  static constexpr TokenBucket::Rate kRate{200, 400};

  struct Parts {
    const HubFacts& facts;
    ShardProxy& shards;
    Links& links;
  };
  explicit RemoteRequests(const Parts& parts) : parts_(parts) {}

  /// Sends a request of a node of this hub on to the hub that it names. Returns why not.
  [[nodiscard]] std::optional<proto::Refusal> send_on(const ControlFrameEvent& event,
                                                      ShardIndex shard,
                                                      std::chrono::milliseconds now);
  /// A frame of kind NS or CTRL that came over a link: it is passed on, or answers a request. True:
  /// it is a request for this hub. Answers to this hub itself: take_own_answers().
  [[nodiscard]] bool take(const ControlFrameEvent& event, std::chrono::milliseconds now);
  [[nodiscard]] std::vector<HubAnswer> take_own_answers() {
    return std::exchange(own_answers_, {});
  }
  /// Answers a request that came over a link.
  void answer(const ControlFrameEvent& event, const proto::Payload& payload);
  /// Answers those whose time is over.
  void tick(std::chrono::milliseconds now);
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_due() const;

 private:
  struct Key {
    NodeId node;
    HubId hub;  ///< that was asked
    std::uint16_t request = 0;
    friend auto operator<=>(const Key&, const Key&) = default;
  };
  struct Asked {
    SessionRef session;
    ShardIndex shard;
    std::uint32_t attachment = 0;
    proto::Kind kind = proto::Kind::ctrl;
    proto::ControlHeader header;
    std::chrono::milliseconds until{};
  };
  void settle(const Key& key, std::vector<std::byte> frame);

  const Parts parts_;
  std::map<Key, Asked> asked_;
  /// In the order of their times. Limit: the requests that the nodes send within kAnswerTime.
  std::deque<std::pair<std::chrono::milliseconds, Key>> due_;
  std::map<NodeId, TokenBucket> rates_;  ///< by neighbour
  std::vector<HubAnswer> own_answers_;   ///< Limit: taken after each frame
};

}  // namespace gimnet::hub
