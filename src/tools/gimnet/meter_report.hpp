#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/gimnet/meter.hpp"
#include "tools/gimnet/paint.hpp"

namespace gimnet::tool {

/// What `gimnet hz` and `gimnet bw` are asked for.
enum class Measure : std::uint8_t { rate, bytes };
/// Of what time: the last window, or all of it.
enum class Span : std::uint8_t { recent, whole };

struct ServiceReading {
  std::string service;
  Reading reading;
  std::uint64_t missed = 0;  ///< since the beginning
  bool latest = false;       ///< of Delivery::latest: what is missed was skipped for newer ones
};

/// An object a service, each on a line. Gaps in milliseconds.
[[nodiscard]] std::string json_of(const std::vector<ServiceReading>& readings, Measure measure,
                                  Span span);
/// A table with a row a service.
[[nodiscard]] std::string text_of(const std::vector<ServiceReading>& readings, Measure measure,
                                  Span span, Paint paint = Paint{});

}  // namespace gimnet::tool
