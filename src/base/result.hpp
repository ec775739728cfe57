#pragma once

#include <string>
#include <utility>
#include <variant>

#include "base/check.hpp"

namespace gimnet {

/// A failure told to a person: what happened, to what, and what to do.
struct Error {
  std::string sentence;
};

/// A value, or the reason why there is none. T and E must differ.
/// Thread safety: as the value's. Errors: reading the side that is not there aborts.
template <class T, class E = Error>
class [[nodiscard]] Result {
 public:
  // Implicit, so that a function says `return value;` or `return error;`.
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  Result(E error) : state_(std::in_place_index<1>, std::move(error)) {}
  /// The value of those arguments, made where it stays: for large ones on the data path.
  template <class... Arguments>
  explicit Result(std::in_place_t /*here*/, Arguments&&... arguments)
      : state_(std::in_place_index<0>, std::forward<Arguments>(arguments)...) {}

  [[nodiscard]] bool has_value() const { return state_.index() == 0; }
  [[nodiscard]] explicit operator bool() const { return has_value(); }

  /// REQUIRES: has_value().
  [[nodiscard]] T& value() {
    GIMNET_CHECK(has_value());
    return *std::get_if<0>(&state_);
  }
  [[nodiscard]] const T& value() const {
    GIMNET_CHECK(has_value());
    return *std::get_if<0>(&state_);
  }
  [[nodiscard]] T& operator*() { return value(); }
  [[nodiscard]] const T& operator*() const { return value(); }
  [[nodiscard]] T* operator->() { return &value(); }
  [[nodiscard]] const T* operator->() const { return &value(); }

  /// REQUIRES: !has_value().
  [[nodiscard]] const E& error() const {
    GIMNET_CHECK(!has_value());
    return *std::get_if<1>(&state_);
  }

 private:
  std::variant<T, E> state_;
};

}  // namespace gimnet
