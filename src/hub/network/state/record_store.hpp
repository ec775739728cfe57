#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "proto/control/route.hpp"

namespace gimnet::hub {

/// One part of a record as it came from a link, or as this hub sent it. Thread safety: immutable.
struct StoredPart {
  proto::route::RecordPart said;
  proto::Payload bytes;    ///< to be passed on, with keys that this version does not know
  std::uint64_t mark = 0;  ///< of this part in a digest: docs/protocol.md, section 10
};
using PartRef = std::shared_ptr<const StoredPart>;

/// Reads a part. Null: it is not a RECORD, or larger than kPartBytesMax.
[[nodiscard]] PartRef read_part(proto::Payload bytes);
/// A part that this hub says.
[[nodiscard]] PartRef make_part(const proto::route::RecordPart& said);

/// Of two parts of one record with the same number: the higher sequence is newer; of two sequences
/// that are more than 2^32 apart the lower one; of equal sequences the higher instance. So a hub
/// that invents a sequence from the far future does not silence the hub that it speaks for.
[[nodiscard]] bool is_newer(const proto::route::RecordPart& part,
                            const proto::route::RecordPart& than);
/// The same of parts as they came. Of two that are equal but for their other contents one is
/// forged: the one with the higher bytes counts as newer, so that all hubs have the same one.
[[nodiscard]] bool is_newer(const StoredPart& part, const StoredPart& than);
/// Do both claim to be one thing that one process said, and differ?
[[nodiscard]] bool contradict(const StoredPart& one, const StoredPart& other);

/// The record of one hub: its parts by number. Part 0 names the instance that counts; parts of
/// another instance do not count.
class StoredRecord {
 public:
  /// Null: that part is not known.
  [[nodiscard]] PartRef part(std::uint16_t number) const;
  [[nodiscard]] const std::vector<PartRef>& parts() const { return parts_; }
  /// Null: nothing counts, since part 0 is not known.
  [[nodiscard]] const proto::route::RecordPart* head() const;
  /// Calls `visit(const StoredPart&)` for each part that counts.
  template <class Visit>
  void each_counting(Visit visit) const {
    const auto* first = head();
    if (first == nullptr) return;
    for (const PartRef& each : parts_) {
      if (each->said.instance == first->instance) visit(*each);
    }
  }
  void put(PartRef part);
  /// Of all parts, with what it costs to keep each of them.
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

  /// Nothing: the hub can be reached.
  std::optional<std::chrono::milliseconds> unreachable_since;
  bool was_reached = false;  ///< since this record is known

 private:
  std::vector<PartRef> parts_;  ///< ascending by number; at most kPartsMax
  std::size_t bytes_ = 0;
};

/// The records of all hubs, by hub id and unique id: whatever came over links, and this hub's own.
/// Thread safety: none. Time is an argument. Errors: what is not taken is told, and counted where
/// it is a fault. Limits: kRecordsOfOneId, kBytesMax and kUnreachableBytesMax. Where one of them is
/// met, the records go of the hubs that could not be reached for longest, never that of a hub at
/// the other end of a link: whoever may link can invent hubs at will. Those of hubs
/// that could not be reached for ten minutes are thrown away by forget().
class RecordStore {
 public:
  /// A hub that lost its state more often within ten minutes is not known as what it was first.
  static constexpr std::size_t kRecordsOfOneId = 64;
  /// All parts of all hubs: five times what 4,000 hubs say that have 64 neighbours each.
  static constexpr std::size_t kBytesMax = 32 * 1024 * 1024;
  /// Of hubs that cannot be reached: that once, since a hub that joins hears of them all before it
  /// can reach any.
  static constexpr std::size_t kUnreachableBytesMax = kBytesMax / 4;
  /// A hub that comes back later begins anew.
  static constexpr std::chrono::milliseconds kForgetAfter = std::chrono::minutes(10);

  enum class Taken : std::uint8_t { newer, known, too_many };
  Taken take(const PartRef& part, std::chrono::milliseconds now);
  /// Keeps what this hub says of itself: others cannot take its place away.
  void put_own(const PartRef& part);

  [[nodiscard]] const std::map<proto::HubKey, StoredRecord>& records() const { return records_; }
  /// Null: it is not known.
  [[nodiscard]] const StoredRecord* find(const proto::HubKey& hub) const;
  /// All parts of all records, in the order of the hubs.
  [[nodiscard]] std::vector<PartRef> all() const;
  /// The same of the hubs that can be reached.
  [[nodiscard]] std::vector<PartRef> reachable() const;

  /// The hubs at the other ends of links, whose records are always taken. REQUIRES: ascending.
  void set_linked(std::vector<proto::HubKey> hubs) { linked_ = std::move(hubs); }
  [[nodiscard]] bool is_linked(const proto::HubKey& hub) const;
  /// These hubs can be reached, and no others. REQUIRES: ascending.
  void set_reachable(std::span<const proto::HubKey> hubs, std::chrono::milliseconds now);
  /// May a record of that hub change which hubs can be reached, and how? It is reachable or linked,
  /// or one that is reachable names it as a neighbour, as of the last set_reachable().
  [[nodiscard]] bool is_near(const proto::HubKey& hub) const;
  void forget(std::chrono::milliseconds now);

  /// Of all records, with what it costs to keep each of them.
  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  /// Of all parts that count of all hubs that can be reached. Equal records give equal digests.
  [[nodiscard]] std::uint64_t digest() const;
  /// Parts that were not taken, and records that others took the place of.
  [[nodiscard]] std::uint64_t too_many() const { return too_many_; }

 private:
  using Records = std::map<proto::HubKey, StoredRecord>;
  [[nodiscard]] bool has_room_for(HubId hub);
  [[nodiscard]] bool has_room_for(std::size_t bytes, bool reachable);
  void put(StoredRecord& record, const PartRef& part);
  Records::iterator drop(Records::iterator record);

  Records records_;                    ///< Limit: kRecordsOfOneId for each hub id
  std::vector<proto::HubKey> linked_;  ///< ascending
  std::vector<proto::HubKey> named_;   ///< by hubs that can be reached, which it cannot; ascending
  std::size_t bytes_ = 0;              ///< of all records
  std::size_t unreachable_bytes_ = 0;  ///< of those of hubs that cannot be reached
  std::uint64_t too_many_ = 0;
};

}  // namespace gimnet::hub
