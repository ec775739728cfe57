#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/check.hpp"
#include "client/nif/outgoing.hpp"
#include "proto/frame/frame_builder.hpp"

namespace gimnet::nif {

/// The last message of one retained service.
struct LastMessage {
  proto::FrameHeader header;  ///< dst is that of the service's group now; src is whatever it was
  std::optional<std::uint64_t> key;
  std::vector<std::byte> extensions;
  std::vector<std::byte> payload;

  /// Frame parts without fragment and payload size. Valid until: this changes.
  [[nodiscard]] proto::FrameParts parts() const;
};

/// Last messages of the own retained services, which hubs keep too until they are started again.
/// Thread safety: guarded by its owner. Limits: below; a message beyond them is not kept but
/// counted, nor is an older message in its place, which would not be the last.
class LastMessages {
 public:
  /// Application data: as much as a hub keeps of one service unless it is told otherwise (its
  /// `retained_message_bytes`).
  static constexpr std::size_t kMessageBytesDefault = std::size_t{16} << 20;
  /// Of all services of a node: as much as a hub keeps of all unless it is told otherwise.
  static constexpr std::size_t kBytesMax = std::size_t{64} << 20;

  /// REQUIRES: message_bytes_max <= kBytesMax.
  explicit LastMessages(std::size_t message_bytes_max = kMessageBytesDefault)
      : message_bytes_max_(message_bytes_max) {
    GIMNET_ASSERT(message_bytes_max <= kBytesMax);
  }

  /// The own service of that name is retained and has this group; 0: none at the moment, what is
  /// kept stays.
  void follow(const std::string& service, std::uint32_t group);
  void forget(const std::string& service);
  /// A message to a group was sent. Allocates only where it is larger than those before it.
  void keep(Outgoing& message);
  /// Nothing: no such service, no group, or nothing is kept of it. Valid until: the next call.
  [[nodiscard]] const LastMessage* find(const std::string& service) const;
  [[nodiscard]] bool empty() const { return by_group_.empty(); }
  /// It is the group of a retained service.
  [[nodiscard]] bool follows(std::uint32_t group) const { return by_group_.contains(group); }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  /// Messages of services with retain that were not kept: too large, or no memory.
  [[nodiscard]] std::uint64_t not_kept() const { return not_kept_; }

 private:
  struct Entry {
    std::uint32_t group = 0;
    bool there = false;
    LastMessage last;
  };
  void leave_group(const Entry& entry);
  void clear(Entry& entry);
  [[nodiscard]] bool keep(Entry& entry, Outgoing& message);

  const std::size_t message_bytes_max_;
  std::map<std::string, Entry> by_service_;             ///< Limit: the own services
  std::unordered_map<std::uint32_t, Entry*> by_group_;  ///< those that have a group
  std::size_t bytes_ = 0;                               ///< memory of all payloads
  std::uint64_t not_kept_ = 0;
};

}  // namespace gimnet::nif
