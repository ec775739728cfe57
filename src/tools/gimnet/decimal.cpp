#include "tools/gimnet/decimal.hpp"

#include <array>
#include <cstdio>

namespace gimnet::tool {

std::string decimal(double value, int places) {
  std::array<char, 400> text{};  // 309 digits of the largest double, and more
  std::snprintf(text.data(), text.size(), "%.*f", places, value);
  return text.data();
}

std::string decimal(double value) {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "%g", value);
  return text.data();
}

std::string byte_count(double bytes) {
  constexpr std::array<const char*, 4> kUnits{" kB", " MB", " GB", " TB"};
  if (bytes < 1000.0) return decimal(bytes, 0) + " B";
  std::size_t unit = 0;
  for (bytes /= 1000.0; bytes >= 999.95 && unit + 1 < kUnits.size(); ++unit) bytes /= 1000.0;
  return decimal(bytes, 1) + kUnits[unit];
}

}  // namespace gimnet::tool
