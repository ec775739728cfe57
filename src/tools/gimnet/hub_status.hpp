#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "gimnet/gimi/records.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {

class JsonWriter;

/// A hub's account of itself at one moment. Thread safety: a value type.
struct HubStatus {
  HubRecord hub;
  std::vector<ShardCounts> shards;
  std::vector<ConnectionRecord> connections;
  std::vector<LinkRecord> links;
};

using Counters = std::vector<std::pair<std::string, std::uint64_t>>;

/// Each counter over all shards and the conductor: the sum, and the largest of those that end in
/// `_max`.
[[nodiscard]] Counters summed(const std::vector<ShardCounts>& shards);

/// accepted + copies = delivered + dropped + queued (docs/protocol.md, section 9).
struct Ledger {
  std::uint64_t accepted = 0;
  std::uint64_t copies = 0;
  std::uint64_t delivered = 0;
  std::uint64_t dropped = 0;
  std::uint64_t queued = 0;
  /// Of those dropped: copies of broadcasts by another way than the shortest one, by which nothing
  /// is lost. A network with several ways has them in its best health.
  std::uint64_t wrong_way = 0;
  /// Holds exactly whenever nothing moves.
  [[nodiscard]] bool exact() const { return accepted + copies == delivered + dropped + queued; }
};
[[nodiscard]] Ledger ledger_of(const Counters& counters);
/// As an object with `exact`, or "ledger: ..." in a line without its end.
void write(JsonWriter& json, const Ledger& ledger);
[[nodiscard]] std::string text_of(const Ledger& ledger);

/// One object and a newline.
[[nodiscard]] std::string json_of(const HubStatus& status);
[[nodiscard]] std::string text_of(const HubStatus& status, Paint paint = Paint{});
/// The same for connections alone: a list of objects, a table.
[[nodiscard]] std::string json_of(const std::vector<ConnectionRecord>& connections);
[[nodiscard]] std::string text_of(const std::vector<ConnectionRecord>& connections,
                                  Paint paint = Paint{});

}  // namespace gimnet::tool
