#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace gimnet::demo {

// Figures as people read them. Thread safety: pure functions.

/// A duration as people read it: "85 µs", "1.24 ms", "2.10 s"; "–" for none.
[[nodiscard]] std::string duration_text(std::optional<std::int64_t> duration_ns);

/// A count with its thousands set apart: "12,345".
[[nodiscard]] std::string count_text(std::uint64_t count);

/// Seconds as "m:ss" or "h:mm:ss".
[[nodiscard]] std::string clock_text(double seconds);

}  // namespace gimnet::demo
