#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "proto/control/ns.hpp"

// Watching nodes and services (docs/protocol.md, section 8): a snapshot, then changes. As ns.hpp.

namespace gimnet::proto::ns {

/// The subjects of a watch: a set of bits.
enum WatchSubjects : std::uint8_t { kWatchNodes = 1, kWatchServices = 2, kWatchAll = 3 };

// WATCH: tell me what there is under that pattern, and what changes. Again under the same number:
// from the start.

struct Watch {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::watch);
  static constexpr const char* kName = "WATCH";
  std::uint32_t watch = 0;  ///< a number that the node chooses, not 0
  std::string pattern;      ///< empty: all
  std::uint8_t subjects = kWatchAll;
  /// Go on behind this version of that epoch, if the hub still can; 0: with a snapshot.
  std::uint64_t epoch = 0;
  std::uint64_t version = 0;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Watch read(Fields& fields);
  friend bool operator==(const Watch&, const Watch&) = default;
};

struct WatchAnswer {
  static constexpr std::uint16_t kOperation = answer_of(NsOperation::watch);
  static constexpr const char* kName = "answer to WATCH";
  bool snapshot = false;  ///< one follows; false: the changes go on where the node said
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static WatchAnswer read(Fields& fields);
  friend bool operator==(const WatchAnswer&, const WatchAnswer&) = default;
};

struct Unwatch {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::unwatch);
  static constexpr const char* kName = "UNWATCH";
  std::uint32_t watch = 0;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Unwatch read(Fields& fields);
  friend bool operator==(const Unwatch&, const Unwatch&) = default;
};

struct UnwatchAnswer {
  static constexpr std::uint16_t kOperation = answer_of(NsOperation::unwatch);
  static constexpr const char* kName = "answer to UNWATCH";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static UnwatchAnswer read(Fields&) { return {}; }
  friend bool operator==(const UnwatchAnswer&, const UnwatchAnswer&) = default;
};

// WATCH_TAKEN: so many WATCH_EVENTS of that watch were taken; the hub may send as many more.

struct WatchTaken {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::watch_taken);
  static constexpr const char* kName = "WATCH_TAKEN";
  std::uint32_t watch = 0;
  std::uint32_t frames = 1;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static WatchTaken read(Fields& fields);
  friend bool operator==(const WatchTaken&, const WatchTaken&) = default;
};

struct WatchTakenAnswer {
  static constexpr std::uint16_t kOperation = answer_of(NsOperation::watch_taken);
  static constexpr const char* kName = "answer to WATCH_TAKEN";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static WatchTakenAnswer read(Fields&) { return {}; }
  friend bool operator==(const WatchTakenAnswer&, const WatchTakenAnswer&) = default;
};

// Events

enum class ChangeKind : std::uint8_t {
  begin = 0,    ///< a snapshot begins: what was told before is void
  present = 1,  ///< part of the snapshot
  end = 2,      ///< the snapshot is complete
  joined = 3,
  left = 4,  ///< for good; of the record only id and name
  away = 5,  ///< its connection broke, its grace time runs
  back = 6,  ///< a new connection
  renamed = 7,
  changed = 8,  ///< something else of the record
  advertised = 9,
  withdrawn = 10,  ///< of the record only group id, name and node id
};

/// News of one node or one service.
struct Change {
  ChangeKind kind = ChangeKind::begin;  ///< as sent: may be a value that is not listed
  std::uint64_t version = 0;            ///< of the hub's names and services after this change
  std::string former_name;              ///< of a node that was renamed
  std::optional<NodeRecord> node;
  std::optional<ServiceRecord> service;
  friend bool operator==(const Change&, const Change&) = default;
};
/// The change as it stands among the values of WATCH_EVENTS.
void write_change(bitestream::Writer& writer, const Change& change);

/// Follows the one before it without a gap if `after` is that one's `version`.
struct WatchEvents {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::watch_events);
  static constexpr const char* kName = "WATCH_EVENTS";
  std::uint32_t watch = 0;
  HubId hub;                  ///< whose nodes and services these are
  std::uint64_t epoch = 0;    ///< of that hub's versions: another one after it was started again
  std::uint64_t after = 0;    ///< the version that these changes continue
  std::uint64_t version = 0;  ///< the version that they lead to
  std::vector<Change> changes;
  void write(bitestream::Writer& writer) const;
  /// All but the changes.
  void write_head(bitestream::Writer& writer) const;
  [[nodiscard]] static WatchEvents read(Fields& fields);
  friend bool operator==(const WatchEvents&, const WatchEvents&) = default;
};

}  // namespace gimnet::proto::ns
