#pragma once

#include <cstddef>
#include <string_view>

namespace gimnet {

/// The beginning of a text in UTF-8, of at most so many bytes, that ends between two characters. Of
/// what is no UTF-8 three bytes less may remain.
[[nodiscard]] inline std::string_view cut_text(std::string_view text, std::size_t bytes_max) {
  if (text.size() <= bytes_max) return text;
  const auto continues = [text](std::size_t at) {
    return (static_cast<unsigned char>(text[at]) & 0xC0) == 0x80;
  };
  std::size_t size = bytes_max;
  while (size > 0 && bytes_max - size < 3 && continues(size)) --size;
  return text.substr(0, size);
}

}  // namespace gimnet
