#pragma once

#include <cctype>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

// Golden vectors: files of hex digits with comments, from `#` to the end of the line. They are
// written down apart from the code, so that code and document cannot drift together.

namespace gimnet::test {

using Bytes = std::vector<std::byte>;

[[nodiscard]] inline Bytes from_hex(std::string_view hex) {
  std::string digits;
  for (const char c : hex) {
    if (std::isxdigit(static_cast<unsigned char>(c)) != 0) digits += c;
  }
  if (digits.size() % 2 != 0) throw std::runtime_error("an odd number of hex digits");
  Bytes bytes;
  for (std::size_t i = 0; i < digits.size(); i += 2) {
    bytes.push_back(static_cast<std::byte>(std::stoi(digits.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

/// The bytes of `tests/vectors/NAME.hex`.
[[nodiscard]] inline Bytes load_vector(const std::string& name) {
  std::ifstream file(std::string(GIMNET_VECTORS_DIR) + "/" + name + ".hex");
  if (!file) throw std::runtime_error("no vector " + name);
  std::string hex;
  for (std::string line; std::getline(file, line);) hex += line.substr(0, line.find('#')) + "\n";
  return from_hex(hex);
}

/// Names of all vectors in a folder, for example "frame/unicast".
[[nodiscard]] inline std::vector<std::string> vectors_in(const std::string& folder) {
  std::vector<std::string> names;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(GIMNET_VECTORS_DIR) + "/" + folder)) {
    if (entry.path().extension() == ".hex")
      names.push_back(folder + "/" + entry.path().stem().string());
  }
  return names;
}

[[nodiscard]] inline Bytes to_bytes(std::string_view text) {
  const auto* bytes = reinterpret_cast<const std::byte*>(text.data());
  return {bytes, bytes + text.size()};
}
[[nodiscard]] inline Bytes to_bytes(std::span<const std::byte> bytes) {
  return {bytes.begin(), bytes.end()};
}

}  // namespace gimnet::test
