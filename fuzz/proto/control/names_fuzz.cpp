// Any text as pattern and name: accepted and matched as by the plainest code. Input: pattern,
// newline, name.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "fuzz/support/fuzz_input.hpp"
#include "proto/control/names.hpp"
#include "proto/control/pattern.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::proto;
using Parts = std::vector<std::string>;

constexpr std::string_view kAllowed =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-";

Parts split_naively(std::string_view text) {
  Parts parts(1);
  for (const char c : text) {
    if (c == '/') {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

bool valid_naively(std::string_view text, bool wildcards) {
  if (text.empty() || text.size() > 255) return false;
  const Parts parts = split_naively(text);
  if (parts.size() > 16) return false;
  for (const auto& part : parts) {
    if (wildcards && (part == "*" || part == "**")) continue;
    if (part.empty() || part == "." || part == ".." ||
        part.find_first_not_of(kAllowed) != std::string::npos)
      return false;
  }
  return true;
}

/// fits[i][j]: the pattern from part i on fits the name from part j on.
bool matches_naively(const Parts& pattern, const Parts& name) {
  std::vector<std::vector<bool>> fits(pattern.size() + 1,
                                      std::vector<bool>(name.size() + 1, false));
  fits[pattern.size()][name.size()] = true;
  for (std::size_t i = pattern.size(); i-- > 0;) {
    for (std::size_t j = name.size() + 1; j-- > 0;) {
      if (pattern[i] == "**") {
        fits[i][j] = fits[i + 1][j] || (j < name.size() && fits[i][j + 1]);
      } else {
        fits[i][j] =
            j < name.size() && (pattern[i] == "*" || pattern[i] == name[j]) && fits[i + 1][j + 1];
      }
    }
  }
  return fits[0][0];
}

/// Checks the parts of a pattern by which the hub finds names without comparing each.
void check_pattern(std::string_view text, std::string_view name) {
  const std::optional<Pattern> pattern = Pattern::parse(text);
  FUZZ_MUST(pattern.has_value() == valid_naively(text, true));
  if (!pattern) return;
  FUZZ_MUST(pattern->text() == text && text.starts_with(pattern->beginning()));
  FUZZ_MUST(pattern->is_name() == valid_naively(text, false));
  if (valid_naively(name, false) && pattern->matches(name))
    FUZZ_MUST(name.starts_with(pattern->beginning()));
}

void check_service_name(std::string_view name) {
  const std::size_t slash = name.rfind('/');
  if (!valid_name(name) || slash == std::string_view::npos) return;
  const std::string_view node = name.substr(0, slash);
  const std::string_view service = name.substr(slash + 1);
  FUZZ_MUST(valid_name(node) && valid_service_name(service));
  FUZZ_MUST(join_service_name(node, service) == name);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const std::size_t newline = text.find('\n');
  const std::string_view pattern = text.substr(0, newline);
  const std::string_view name =
      newline == std::string_view::npos ? std::string_view() : text.substr(newline + 1);
  FUZZ_MUST(valid_name(name) == valid_naively(name, false));
  FUZZ_MUST(valid_pattern(pattern) == valid_naively(pattern, true));
  const bool legal = valid_naively(name, false) && valid_naively(pattern, true);
  FUZZ_MUST(matches(pattern, name) ==
            (legal && matches_naively(split_naively(pattern), split_naively(name))));
  check_pattern(pattern, name);
  check_service_name(name);
  return 0;
}
