#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hub/observe/counters.hpp"
#include "proto/control/ctrl.hpp"
#include "proto/control/link.hpp"
#include "proto/control/ns.hpp"

namespace gimnet::hub {

/// Peers that were turned away before they were admitted, by why, and frames of links that were not
/// taken.
/// Thread safety: written by the conductor's thread only, read by anybody.
struct RefusalCounters {
  std::array<Counter, proto::kGoodbyeCount> by_code;  ///< told with GOODBYE
  Counter garbage;                                    ///< what they sent is not this protocol
  Counter unfinished;     ///< they ended in the middle of their opening or HELLO
  Counter no_descriptor;  ///< the hub had no descriptor to keep them
  Counter links_overrun;  ///< frames of links: more waited for the conductor than may

  /// A code that is not listed is not counted.
  void count(proto::GoodbyeCode code) {
    const auto index = static_cast<std::size_t>(code);
    if (index < by_code.size()) by_code[index].add(1);
  }
  [[nodiscard]] std::uint64_t of(proto::GoodbyeCode code) const {
    return by_code[static_cast<std::size_t>(code)].value();
  }
};

/// Requests of admitted nodes, HubNS and HubCtrl each: by operation, and those that were not
/// granted, by status. Thread safety: written by the conductor's thread only, read by anybody.
struct RequestCounters {
  template <std::size_t operations>
  struct Protocol {
    std::array<Counter, operations> by_operation;      ///< refused ones included
    Counter unknown;                                   ///< operations that this hub does not have
    std::array<Counter, proto::kStatusCount> refused;  ///< by status

    void count(std::uint16_t operation, bool known, proto::Status status) {
      (known ? by_operation[operation] : unknown).add(1);
      const auto index = static_cast<std::size_t>(status);
      if (status != proto::Status::done && index < refused.size()) refused[index].add(1);
    }
  };

  Protocol<proto::ns::kRequestsEnd> names;
  Protocol<proto::ctrl::kRequestsEnd> ctrl;
  Counter resyncs;  ///< watches that were too far behind and began again

  void count(proto::Kind kind, std::uint16_t operation, proto::Status status) {
    if (kind == proto::Kind::ns)
      names.count(operation, proto::ns::operation_name(operation) != nullptr, status);
    if (kind == proto::Kind::ctrl)
      ctrl.count(operation, proto::ctrl::operation_name(operation) != nullptr, status);
  }
};

}  // namespace gimnet::hub
