#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "gimnet/gimi/records.hpp"
#include "gimnet/gimi_records.h"

// The records of the C API: they point into those of C++, which their list keeps.

namespace gimnet::gimi {

// Valid until: `of` changes or goes.
[[nodiscard]] gimi_node_record record_of(const NodeRecord& of);
[[nodiscard]] gimi_service_record record_of(const ServiceRecord& of);
[[nodiscard]] gimi_hub_record record_of(const HubRecord& of);
[[nodiscard]] gimi_connection_record record_of(const ConnectionRecord& of);
[[nodiscard]] gimi_link_record record_of(const LinkRecord& of);
[[nodiscard]] gimi_hub_change_record record_of(const HubChange& of);
[[nodiscard]] gimi_trace_hop_record record_of(const TraceHop& of);

/// The memory of a gimi_list. Thread safety: it does not change.
class RecordList {
 public:
  virtual ~RecordList() = default;
};

/// Records of one kind, with what they point to.
template <class Record, class CRecord>
class RecordsOf final : public RecordList {
 public:
  explicit RecordsOf(std::vector<Record> of) : of_(std::move(of)) {
    for (const Record& each : of_) records_.push_back(record_of(each));
  }
  [[nodiscard]] gimi_list list() {
    return {records_.size(), sizeof(CRecord), records_.data(), static_cast<RecordList*>(this)};
  }

 private:
  std::vector<Record> of_;
  std::vector<CRecord> records_;
};

/// A list that owns the records.
template <class Record>
[[nodiscard]] gimi_list list_of(std::vector<Record> records) {
  using CRecord = decltype(record_of(records.front()));
  return (new RecordsOf<Record, CRecord>(std::move(records)))->list();
}
/// Its counters one behind another.
[[nodiscard]] gimi_list list_of(std::vector<ShardCounts> shards);
/// With the edges of each.
[[nodiscard]] gimi_list list_of(std::vector<NetworkHub> hubs);

/// An event that owns what it points to.
[[nodiscard]] gimi_watch_event event_of(WatchEvent event);

}  // namespace gimnet::gimi
