#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/nif/locked_file.hpp"

namespace gimnet::nif {

// The file in which a named node's session token outlives its program: docs/nif.md, "Tokens".
// Thread safety: value types and pure functions.

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

/// Keeps one node's session token where the node's next life finds it, and where a second program
/// of the same name sees that this one lives. What fails here costs the node nothing but its id
/// after a crash. Thread safety: none; one thread at a time. Ownership: of a locked file.
class TokenStore {
 public:
  /// `name` "": a node without one, which keeps nothing. `enabled` false: the program does not want
  /// it.
  TokenStore(std::string name, bool enabled);
  ~TokenStore();
  TokenStore(const TokenStore&) = delete;
  TokenStore& operator=(const TokenStore&) = delete;

  /// The token that an earlier life left for the hub at `address`; empty if there is none, or if
  /// the node that has it still lives. The file stays locked.
  [[nodiscard]] std::vector<std::byte> find(const std::string& address);
  /// The hub at `address` gave this one. A file for another address goes.
  void keep(const std::string& address, const std::vector<std::byte>& token);
  /// The session is over: nobody is to find the token.
  void forget();
  /// The node has another name now, "" for none: the file of the former one goes, and what keep()
  /// is given next stands in that of the new one.
  void rename(std::string name);
  /// Others may have the token from now on.
  void release();

  /// The latest token is in its file.
  [[nodiscard]] bool kept() const { return kept_; }
  /// "" or why it is not, or why the token that find() met is not used; names the file.
  [[nodiscard]] const std::string& fault() const { return fault_; }

 private:
  /// Opens the file for that address, unless it is open. `made`: makes it if there is none.
  [[nodiscard]] bool open(const std::string& address, bool made);
  /// Of the file for the address.
  [[nodiscard]] std::string path() const;
  [[nodiscard]] bool enabled() const { return wanted_ && !name_.empty(); }

  std::string name_;
  const bool wanted_;
  std::unique_ptr<PrivateFolder> folder_;  ///< opened when it is first needed
  LockedFile file_;
  std::string address_;  ///< for which it is open
  bool kept_ = false;
  std::string fault_;
  std::string unused_;  ///< why the file that find() met is not used; told once
};

}  // namespace gimnet::nif
