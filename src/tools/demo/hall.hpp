#pragma once

#include <string_view>

namespace gimnet::demo {

/// The built-in hall, 18 m by 12 m, in the format of WorldMap: a workshop with pillars, shelves and
/// an office.
extern const std::string_view kHallText;

}  // namespace gimnet::demo
