#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "gimnet/gimi/records.hpp"
#include "tools/gimnet/json_writer.hpp"

namespace gimnet::tool {

/// Writes a record as an object, everywhere with the same members.
void write(JsonWriter& json, const NodeRecord& node);
/// `place`: that of its node, where it is known.
void write(JsonWriter& json, const ServiceRecord& service,
           std::optional<std::string_view> place = std::nullopt);

[[nodiscard]] const char* text_of(Direction direction);
/// As `pub --delivery` takes it.
[[nodiscard]] std::string delivery_of(const ServiceRecord& service);

}  // namespace gimnet::tool
