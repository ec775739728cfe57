#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
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

/// The record of one hub: its parts by number. Part 0 names the instance that counts; parts of
/// another instance do not count.
class StoredRecord {
 public:
  /// Null: that part is not known.
  [[nodiscard]] const StoredPart* part(std::uint16_t number) const;
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

  /// Nothing: the hub can be reached.
  std::optional<std::chrono::milliseconds> unreachable_since;

 private:
  std::vector<PartRef> parts_;  ///< ascending by number; at most kPartsMax
};

/// The records of all hubs, by hub id and unique id: whatever came over links, and this hub's own.
/// Thread safety: none. Time is an argument. Errors: what is not taken is told, and counted where
/// it is a fault. Limits: kRecordsOfOneId; records of hubs that could not be reached for ten
/// minutes are thrown away by forget(), never when another record comes.
class RecordStore {
 public:
  /// A hub that lost its state so many times within ten minutes is not known under a new unique id.
  static constexpr std::size_t kRecordsOfOneId = 64;
  /// All parts of all other hubs, in bytes: five times what 4,000 hubs in a star say.
  static constexpr std::size_t kBytesMax = 32 * 1024 * 1024;
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

  /// These hubs can be reached, and no others. REQUIRES: ascending.
  void set_reachable(std::span<const proto::HubKey> hubs, std::chrono::milliseconds now);
  void forget(std::chrono::milliseconds now);

  /// Of all parts that count of all hubs that can be reached. Equal records give equal digests.
  [[nodiscard]] std::uint64_t digest() const;
  /// Parts that were not taken because of kRecordsOfOneId or kBytesMax.
  [[nodiscard]] std::uint64_t too_many() const { return too_many_; }

 private:
  [[nodiscard]] bool has_room_for(HubId hub) const;

  std::map<proto::HubKey, StoredRecord> records_;  ///< Limit: kRecordsOfOneId for each hub id
  std::size_t bytes_ = 0;                          ///< of the parts of other hubs
  std::uint64_t too_many_ = 0;
};

}  // namespace gimnet::hub
