#pragma once

#include <string>
#include <vector>

#include "base/ids.hpp"
#include "hub/config/settings.hpp"
#include "hub/config/value.hpp"

// The keys that links are configured by: `link`, and those of the table `[links]`
// (docs/operations.md, "Links"). Thread safety: pure functions. Errors: faults.

namespace gimnet::hub {

inline constexpr std::size_t kLinkKeepAliveMsMin = 10;
inline constexpr std::size_t kLinkSilentMsMin = 30;
inline constexpr std::size_t kLinkMsMax = 3'600'000;

/// Tables `[[link]]`, or URLs of flags and of the environment.
void set_link(Configuration& configuration, const Given& given, Faults& faults);
/// Without passwords.
[[nodiscard]] std::string show_link(const HubOptions& options);

void set_accept_links(Configuration& configuration, const Given& given, Faults& faults);
/// `links.keep_alive_ms`, `links.silent_ms` and `links.allow`.
void set_accepted_terms(Configuration& configuration, const Given& given, Faults& faults);
/// As a list of numbers.
[[nodiscard]] std::string show_hubs(const std::vector<HubId>& hubs);

/// Looks at what must agree. To be called when all keys are known.
void complete_links(Configuration& configuration, Faults& faults);

}  // namespace gimnet::hub
