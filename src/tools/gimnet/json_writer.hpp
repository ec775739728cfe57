#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "gimnet/gimi/records.hpp"

namespace gimnet::tool {

/// Writes one JSON value. Text that is no UTF-8 has U+FFFD in place of the bytes that are wrong;
/// bytes() does not lose them. Thread safety: one thread.
class JsonWriter {
 public:
  JsonWriter& begin_object() { return open('{'); }
  JsonWriter& end_object() { return close('}'); }
  JsonWriter& begin_array() { return open('['); }
  JsonWriter& end_array() { return close(']'); }
  JsonWriter& key(std::string_view name);
  JsonWriter& text(std::string_view value);
  JsonWriter& boolean(bool value);
  JsonWriter& number(double value);
  template <std::integral Integer>
  JsonWriter& number(Integer value) {
    return literal(std::to_string(value));
  }

  template <class Value>
  JsonWriter& member(std::string_view name, const Value& value) {
    key(name);
    if constexpr (std::same_as<Value, bool>)
      return boolean(value);
    else if constexpr (std::integral<Value> || std::floating_point<Value>)
      return number(value);
    else
      return text(value);
  }
  /// As `name` where they are UTF-8, else as `name_hex`.
  JsonWriter& bytes_member(const std::string& name, std::span<const std::byte> bytes);

  [[nodiscard]] const std::string& str() const { return json_; }

 private:
  JsonWriter& open(char bracket);
  JsonWriter& close(char bracket);
  JsonWriter& literal(std::string_view text);
  void separate();
  void quote(std::string_view text);
  void escape(unsigned code);

  std::string json_;
  bool first_ = true;
};

/// Writes a record as an object, everywhere with the same members.
/// `state`: as ToolSession::standing_of(), where it is known.
void write(JsonWriter& json, const NodeRecord& node,
           std::optional<std::string_view> state = std::nullopt);
/// The node that has a service: its place, and its state as ToolSession::standing_of().
struct Provider {
  std::string_view place;
  std::string_view state = "-";
};
/// `provider`: where it is known.
void write(JsonWriter& json, const ServiceRecord& service,
           std::optional<Provider> provider = std::nullopt);

/// "provides", "accepts", or "answers" of one that answers requests.
[[nodiscard]] const char* direction_of(const ServiceRecord& service);
/// As `pub --delivery` takes it.
[[nodiscard]] std::string delivery_of(const ServiceRecord& service);

}  // namespace gimnet::tool
