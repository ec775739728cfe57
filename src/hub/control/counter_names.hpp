#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "hub/observe/counters.hpp"
#include "hub/observe/request_counters.hpp"

namespace gimnet::hub {

/// Calls `take` with the name and value of every counter, as STATISTICS lists them: the field's
/// name, and "dropped.queue_full" and so on for the reasons. Thread safety: any thread.
void for_each_counter(
    const ShardCounters& counters,
    const std::function<void(const std::string& name, std::uint64_t value)>& take);
/// The same for the peers that were not admitted: "refused.hub_full" and so on, "refused.garbage",
/// "refused.unfinished", "refused.no_descriptor".
void for_each_counter(
    const RefusalCounters& counters,
    const std::function<void(const std::string& name, std::uint64_t value)>& take);
/// The same for requests about names and services: "names.resolve" and so on, "names.unknown",
/// "names.refused.not_found" and so on; and for those about the hub: "ctrl.kick" and so on.
void for_each_counter(
    const RequestCounters& counters,
    const std::function<void(const std::string& name, std::uint64_t value)>& take);

}  // namespace gimnet::hub
