#include "proto/control/names.hpp"

#include <array>
#include <cstdint>
#include <optional>

namespace gimnet::proto {
namespace {

constexpr bool is_name_character(char c) {
  return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '.' || c == '_' || c == '-';
}

constexpr bool is_wildcard(std::string_view part) { return part == "*" || part == "**"; }

struct Parts {
  std::array<std::string_view, kNamePartsMax> part;
  std::size_t count = 0;
};

/// Nothing: more than 16 parts.
std::optional<Parts> split(std::string_view text) {
  Parts parts;
  for (;;) {
    if (parts.count == kNamePartsMax) return std::nullopt;
    const auto slash = text.find('/');
    parts.part[parts.count++] = text.substr(0, slash);
    if (slash == std::string_view::npos) return parts;
    text.remove_prefix(slash + 1);
  }
}

const char* part_fault(std::string_view part) {
  if (part.empty()) return "it has an empty part";
  for (const char c : part) {
    if (!is_name_character(c)) return "it has a character other than A-Z a-z 0-9 . _ - and /";
  }
  return nullptr;
}

enum class Wildcards { refused, allowed };

const char* fault(std::string_view text, Wildcards wildcards) {
  if (text.empty()) return "it is empty";
  if (text.size() > kNameBytesMax) return "it has more than 255 bytes";
  const auto parts = split(text);
  if (!parts) return "it has more than 16 parts";
  for (std::size_t i = 0; i < parts->count; ++i) {
    if (wildcards == Wildcards::allowed && is_wildcard(parts->part[i])) continue;
    if (const char* found = part_fault(parts->part[i])) return found;
  }
  return nullptr;
}

/// Bit i: the name's parts so far fit the pattern's first i parts.
using States = std::uint32_t;

/// Where `**` is next, it may also stand for no part at all.
States skip_stars(States states, const Parts& pattern) {
  for (std::size_t i = 0; i < pattern.count; ++i) {
    if (((states >> i) & 1u) != 0 && pattern.part[i] == "**") states |= 1u << (i + 1);
  }
  return states;
}

States step(States states, const Parts& pattern, std::string_view part) {
  States next = 0;
  for (std::size_t i = 0; i < pattern.count; ++i) {
    if (((states >> i) & 1u) == 0) continue;
    if (pattern.part[i] == "**") {
      next |= 1u << i;
    } else if (pattern.part[i] == "*" || pattern.part[i] == part) {
      next |= 1u << (i + 1);
    }
  }
#if defined(GIMNET_BUG_STARS_NEED_A_PART)
  return next;
#else
  return skip_stars(next, pattern);
#endif
}

}  // namespace

const char* name_fault(std::string_view name) { return fault(name, Wildcards::refused); }

bool valid_pattern(std::string_view pattern) { return fault(pattern, Wildcards::allowed) == nullptr; }

bool matches(std::string_view pattern, std::string_view name) {
  if (!valid_pattern(pattern) || !valid_name(name)) return false;
  const Parts pattern_parts = *split(pattern);
  const Parts name_parts = *split(name);
  States states = skip_stars(1u, pattern_parts);
  for (std::size_t i = 0; i < name_parts.count && states != 0; ++i) {
    states = step(states, pattern_parts, name_parts.part[i]);
  }
  return ((states >> pattern_parts.count) & 1u) != 0;
}

ServiceName split_service_name(std::string_view full_name) {
  const auto slash = full_name.rfind('/');
  if (slash == std::string_view::npos) return {};
  return {full_name.substr(0, slash), full_name.substr(slash + 1)};
}

std::string join_service_name(std::string_view node, std::string_view service) {
  std::string full_name;
  full_name.reserve(node.size() + 1 + service.size());
  return full_name.append(node).append("/").append(service);
}

bool valid_service_name(std::string_view service) {
  return valid_name(service) && service.find('/') == std::string_view::npos;
}

}  // namespace gimnet::proto
