#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

// The file in which a named node's session token outlives its program: docs/nif.md, "Tokens".
// Thread safety: value types and pure functions.

namespace gimnet::nif {

struct TokenRecord {
  std::string address;           ///< of the hub, as a URL
  std::string name;              ///< of the node
  std::vector<std::byte> token;  ///< 1..128 bytes
  friend bool operator==(const TokenRecord&, const TokenRecord&) = default;
};

/// The longest file that is written or read.
inline constexpr std::size_t kTokenRecordBytesMax = 1'024;

/// Nothing: the address is so long that the file would be, too.
[[nodiscard]] std::optional<std::vector<std::byte>> write_token_record(const TokenRecord& record);
/// The file is not trusted. Nothing: it holds something else, or is cut or longer than it says.
[[nodiscard]] std::optional<TokenRecord> read_token_record(std::span<const std::byte> bytes);

/// The file's name for that node at that hub: readable, without anything that means something to a
/// file system, and another one for another address or name but for chance; the record says for
/// which it is.
[[nodiscard]] std::string token_file_name(std::string_view address, std::string_view name);

}  // namespace gimnet::nif
