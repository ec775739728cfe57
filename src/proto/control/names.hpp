#pragma once

#include <cstddef>
#include <string>
#include <string_view>

// Names of nodes and services, and patterns over them (docs/protocol.md, section 8).
// Thread safety: pure functions. Cost: linear in the name, at most 16 x 16 comparisons of parts for
// a pattern.

namespace gimnet::proto {

inline constexpr std::size_t kNameBytesMax = 255;
inline constexpr std::size_t kNamePartsMax = 16;

/// The fault of a name, as a clause for a sentence ("it is empty"); nullptr: there is none.
[[nodiscard]] const char* name_fault(std::string_view name);
[[nodiscard]] inline bool valid_name(std::string_view name) { return name_fault(name) == nullptr; }
/// The same of a node's name, which besides must not read as an id does (`7.17`): whoever sends
/// there means the id.
[[nodiscard]] const char* node_name_fault(std::string_view name);
/// The same of the full name of a service, NODE/SERVICE, which one subscribes to.
[[nodiscard]] const char* service_full_name_fault(std::string_view name);

/// A name, of which parts may be `*` (one part) or `**` (any number, none included).
[[nodiscard]] bool valid_pattern(std::string_view pattern);

/// Does the whole name fit the pattern? False where one of them is not valid.
[[nodiscard]] bool matches(std::string_view pattern, std::string_view name);

/// The full name of a service: what stands behind its last '/' is the name within its node.
[[nodiscard]] std::string join_service_name(std::string_view node, std::string_view service);

/// The name of a service within its node: a valid name of one part.
[[nodiscard]] bool valid_service_name(std::string_view service);

}  // namespace gimnet::proto
