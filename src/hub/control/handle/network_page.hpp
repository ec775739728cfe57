#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "hub/control/handle/request.hpp"

namespace gimnet::hub {

/// A claim that a hub made before it was started again, to a name that another node has by now. It
/// is listed no more.
[[nodiscard]] inline bool is_replaced(const HandlerContext& context, const KnownName& known) {
  if (known.standing != proto::ns::NameStanding::unreachable || known.claim->version != 0)
    return false;
  const auto best = context.names->copies()->find(known.name);
  return best && best->claim->node != known.claim->node &&
         best->standing == proto::ns::NameStanding::held;
}

/// One page of a listing over all hubs: this hub's own records among those of the others, by
/// ascending id, in a bounded piece of work. Thread safety: none.
template <class Id, class Record>
class NetworkPage {
 public:
  NetworkPage(const HandlerContext& context, Id after, std::uint32_t records_wanted)
      : own_(context.facts.id),
        work_(context.limits.scan_records),
        next_(after),
        budget_(context.limits, records_wanted) {}

  /// `after(names, id)` gives the next name of any hub, and `record(known)` its record if it is
  /// wanted. `list(index)` gives a Listed of own records behind that index, and `own_record(index)`
  /// one of them. `names`: nullptr for own ones alone.
  template <class After, class Wanted, class List, class OwnRecord>
  void fill(const NameCopies* names, After after, Wanted record, List list, OwnRecord own_record) {
    const Id first = make_id<Id>(own_, 0);
    const Id last = make_id<Id>(own_, kIndexMask);
    if (names != nullptr && !add_others(*names, first, after, record)) return;
    if (next_ < last) {
      // A page may continue after an id of hub 0, which stands for this hub.
      const bool begun = next_ >= first || hub_of(next_) == kOwnHub;
      const auto listed = list(begun ? index_of(next_) : 0);
      for (const auto index : listed.indices) {
        if (!add(own_record(index), make_id(own_, index))) return;
      }
      if (listed.more) {
        next_ = make_id(own_, listed.next);
        more_ = true;
        return;
      }
      next_ = last;
    }
    if (names != nullptr)
      static_cast<void>(add_others(*names, Id{~std::uint32_t{0}}, after, record));
  }

  [[nodiscard]] std::vector<Record> take_records() { return std::move(records_); }
  [[nodiscard]] bool more() const { return more_; }
  /// If there are more: continue after this one. Else 0.
  [[nodiscard]] Id next() const { return more_ ? next_ : Id{}; }

 private:
  /// Those up to `end`. False: the page ends.
  template <class After, class Wanted>
  [[nodiscard]] bool add_others(const NameCopies& names, Id end, After after, Wanted record) {
    while (const auto known = after(names, next_)) {
      const Id id = id_of<Id>(*known);
      if (id >= end) break;
      if (work_-- == 0) {
        more_ = true;
        return false;
      }
      if (auto wanted = record(*known)) {
        if (!add(std::move(*wanted), id)) return false;
      } else {
        next_ = id;
      }
    }
    return true;
  }
  [[nodiscard]] bool add(Record record, Id id) {
    if (!budget_.take(proto::ns::page_bytes_max(record))) {
      more_ = true;
      return false;
    }
    records_.push_back(std::move(record));
    next_ = id;
    return true;
  }

  const HubId own_;
  std::size_t work_;
  Id next_;
  PageBudget budget_;
  std::vector<Record> records_;
  bool more_ = false;
};

}  // namespace gimnet::hub
