#include "proto/control/names.hpp"

#include <array>
#include <optional>

#include "proto/control/pattern.hpp"

namespace gimnet::proto {
namespace {

constexpr bool is_name_character(char c) {
  return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '.' ||
         c == '_' || c == '-';
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
  if (part.empty()) return "it has an empty part: between two parts stands one /";
  if (part == "." || part == "..") return "it has a part . or .., which belongs into paths";
  for (const char c : part) {
    if (!is_name_character(c)) return "it has a character other than A-Z a-z 0-9 . _ - and /";
  }
  return nullptr;
}

bool is_number(std::string_view text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string_view::npos;
}

/// Of numbers of any size: what is no id today may be one for somebody else.
bool reads_as_id(std::string_view name) {
  const auto dot = name.find('.');
  return dot != std::string_view::npos && is_number(name.substr(0, dot)) &&
         is_number(name.substr(dot + 1));
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

}  // namespace

const char* name_fault(std::string_view name) { return fault(name, Wildcards::refused); }

const char* node_name_fault(std::string_view name) {
  if (const char* found = name_fault(name)) return found;
  return reads_as_id(name) ? "it reads as the id of a node does, NUMBER.NUMBER" : nullptr;
}

const char* service_full_name_fault(std::string_view name) {
  if (name.find('*') != std::string_view::npos && valid_pattern(name)) {
    return "it is a pattern, and one service is meant: watch() tells which services match";
  }
  if (const char* found = name_fault(name)) return found;
  const auto slash = name.rfind('/');
  if (slash == std::string_view::npos) return "it is no full name of a service: write NODE/SERVICE";
  return reads_as_id(name.substr(0, slash))
             ? "it begins with an id, and services are called by names: write NODE/SERVICE with "
               "the name of the node"
             : nullptr;
}

bool valid_pattern(std::string_view pattern) {
  return fault(pattern, Wildcards::allowed) == nullptr;
}

bool matches(std::string_view pattern, std::string_view name) {
  const std::optional<Pattern> parsed = Pattern::parse(pattern);
  return parsed && valid_name(name) && parsed->matches(name);
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
