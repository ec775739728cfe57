#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <optional>
#include <span>
#include <string>

#include "client/nif/error.hpp"

// Structures of the C API whose first member is struct_size: gimnet/nif.h, "Versions".

namespace gimnet::nif {

/// No structure of any version is larger.
inline constexpr std::size_t kStructSizeMax = 4096;

/// Does the program set a member that is kept for later versions? Ignoring it would keep them from
/// ever using it.
template <class Struct>
[[nodiscard]] bool sets_reserved(const Struct& given) {
  if constexpr (requires { given.reserved; }) {
    const auto bytes = std::as_bytes(std::span(&given.reserved, 1));
    return std::ranges::any_of(bytes, [](std::byte byte) { return byte != std::byte{0}; });
  } else {
    return false;
  }
}

/// A structure of the program, as this version of the library has it. A program with an older
/// header gives a shorter one: the members that it lacks are zero, the default. A newer header
/// may give a longer one, as long as it asks for nothing there, and nothing in the members that
/// are reserved. `given` leads to `whole` if its size is another one.
/// `doing` and `name` are for the sentence.
template <class Struct>
[[nodiscard]] std::optional<Failure> read_struct(const Struct*& given, Struct& whole,
                                                 const char* doing, const char* name) {
  const std::size_t size = given->struct_size;
  const auto bad = [&](const char* why) {
    return Failure{NIF_BAD_ARGUMENT, std::string("cannot ") + doing + ": " + name + why};
  };
  // No std::string before it is needed: each message comes by here.
  constexpr const char* unknown =
      " asks for something that this version of the library does not have";
  if (size == sizeof(Struct)) {
    if (sets_reserved(*given)) return bad(unknown);
    return std::nullopt;
  }
  if (size < sizeof(std::size_t) || size > kStructSizeMax)
    return bad((std::string(".struct_size is not sizeof(") + name + ")").c_str());
  const auto* bytes = reinterpret_cast<const unsigned char*>(given);
  const auto asked = [](unsigned char byte) { return byte != 0; };
  if (size > sizeof whole && std::any_of(bytes + sizeof whole, bytes + size, asked))
    return bad(unknown);
  whole = {};
  std::memcpy(&whole, bytes, std::min(size, sizeof whole));
  given = &whole;
  if (sets_reserved(whole)) return bad(unknown);
  return std::nullopt;
}

/// Gives a program as much of `whole` as the structure has that it gave. REQUIRES: has_size(given).
template <class Struct>
void write_struct(const Struct& whole, Struct& given) {
  const std::size_t size = given.struct_size;
  std::memcpy(&given, &whole, std::min(size, sizeof whole));
  given.struct_size = size;
}

/// Can anything be written into it?
template <class Struct>
[[nodiscard]] bool has_size(const Struct* given) {
  return given != nullptr && given->struct_size >= sizeof(std::size_t);
}

}  // namespace gimnet::nif
