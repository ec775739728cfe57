#pragma once

#include <string>

namespace gimnet::tool {

/// A number for people: with `places` digits behind the point, or, without them, as few as it needs
/// (at most 6).
[[nodiscard]] std::string decimal(double value, int places);
[[nodiscard]] std::string decimal(double value);
/// Bytes with the unit that suits them, powers of 1,000: "999 B", "1.5 kB", "2.0 MB".
[[nodiscard]] std::string byte_count(double bytes);

}  // namespace gimnet::tool
