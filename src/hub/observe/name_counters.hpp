#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hub/observe/counters.hpp"
#include "proto/control/ns.hpp"

namespace gimnet::hub {

/// HubNS requests of admitted nodes, by operation, and those that were refused, by status.
/// Thread safety: written by the conductor's thread only, read by anybody.
struct NameCounters {
  std::array<Counter, proto::ns::kRequestsEnd> by_operation;  ///< refused ones included
  Counter unknown;                                            ///< operations that this hub does not have
  std::array<Counter, proto::kStatusCount> refused;
  Counter resyncs;  ///< watches that were too far behind and began again

  void count(std::uint16_t operation, proto::Status status) {
    (proto::ns::operation_name(operation) != nullptr ? by_operation[operation] : unknown).add(1);
    const auto index = static_cast<std::size_t>(status);
    if (status != proto::Status::done && index < refused.size()) refused[index].add(1);
  }
  [[nodiscard]] std::uint64_t of(proto::ns::Operation operation) const {
    return by_operation[static_cast<std::size_t>(operation)].value();
  }
};

}  // namespace gimnet::hub
