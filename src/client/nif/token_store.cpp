#include "client/nif/token_store.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "base/endian.hpp"
#include "proto/control/fields.hpp"

namespace gimnet::nif {

namespace {

// Layout, little-endian: magic, u16 version, u16 sizes of token, name and address, then those.
constexpr std::string_view kMagic = "GIMtoken";
constexpr std::uint16_t kVersion = 1;
constexpr std::size_t kSizesAt = 10;
constexpr std::size_t kHeadSize = 16;
/// Bytes of a name in the name of its file, which has to stay below 255 bytes.
constexpr std::size_t kReadableMax = 60;

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span{text});
}

/// FNV-1a. Chance only: who is fooled by a collision finds another node's record there, which says
/// so.
std::uint64_t hash_of(std::string_view text, std::uint64_t hash) {
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100'0000'01b3u;
  return hash;
}

std::string text_at(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

std::optional<std::vector<std::byte>> write_token_record(const TokenRecord& record) {
  const std::size_t size =
      kHeadSize + record.token.size() + record.name.size() + record.address.size();
  if (record.token.empty() || record.token.size() > proto::kTokenBytesMax ||
      size > kTokenRecordBytesMax) {
    return std::nullopt;
  }
  std::vector<std::byte> bytes(kHeadSize);
  const auto magic = bytes_of(kMagic);
  std::copy(magic.begin(), magic.end(), bytes.begin());
  store_le(bytes.data() + kMagic.size(), kVersion);
  store_le(bytes.data() + kSizesAt, static_cast<std::uint16_t>(record.token.size()));
  store_le(bytes.data() + kSizesAt + 2, static_cast<std::uint16_t>(record.name.size()));
  store_le(bytes.data() + kSizesAt + 4, static_cast<std::uint16_t>(record.address.size()));
  for (const auto part : {std::span<const std::byte>{record.token}, bytes_of(record.name),
                          bytes_of(record.address)}) {
    bytes.insert(bytes.end(), part.begin(), part.end());
  }
  return bytes;
}

std::optional<TokenRecord> read_token_record(std::span<const std::byte> bytes) {
  if (bytes.size() < kHeadSize || bytes.size() > kTokenRecordBytesMax) return std::nullopt;
  const auto magic = bytes_of(kMagic);
  if (!std::equal(magic.begin(), magic.end(), bytes.begin())) return std::nullopt;
  if (load_le<std::uint16_t>(bytes.data() + kMagic.size()) != kVersion) return std::nullopt;
  std::array<std::size_t, 3> sizes{};
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    sizes[i] = load_le<std::uint16_t>(bytes.data() + kSizesAt + 2 * i);
  }
  const std::span<const std::byte> rest = bytes.subspan(kHeadSize);
  if (sizes[0] + sizes[1] + sizes[2] != rest.size()) return std::nullopt;
  if (sizes[0] == 0 || sizes[0] > proto::kTokenBytesMax) return std::nullopt;
  TokenRecord record;
  const auto token = rest.first(sizes[0]);
  record.token.assign(token.begin(), token.end());
  record.name = text_at(rest.subspan(sizes[0], sizes[1]));
  record.address = text_at(rest.subspan(sizes[0] + sizes[1]));
  return record;
}

std::string token_file_name(std::string_view address, std::string_view name) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const char c : name.substr(0, kReadableMax)) {
    const bool plain =
        (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-';
    text += plain ? c : '_';
  }
  text += '.';
  // A character that is in neither keeps ("ab", "c") and ("a", "bc") apart.
  const std::uint64_t hash =
      hash_of(name, hash_of(std::string_view{"\n", 1}, hash_of(address, 0xcbf2'9ce4'8422'2325u)));
  for (int shift = 60; shift >= 0; shift -= 4) text += kDigits[(hash >> shift) & 15];
  return text;
}

TokenStore::TokenStore(std::string name, bool enabled) : name_(std::move(name)), wanted_(enabled) {}

TokenStore::~TokenStore() = default;

std::vector<std::byte> TokenStore::find(const std::string& address) {
  if (!open(address, false)) return {};
  // One byte more than is legal, so that a longer file shows.
  std::array<std::byte, kTokenRecordBytesMax + 1> memory;
  const std::size_t size = file_.read(memory);
  if (size == 0) return {};  // a program ended before it wrote its token
  const auto record = read_token_record(std::span(memory).first(size));
  if (record && record->address == address && record->name == name_) return record->token;
  unused_ = "the token file " + path() + " is not used, and the node may get a new id: " +
            (record ? "it is that of another node" : "what it holds is no session token");
  return {};
}

std::string TokenStore::path() const {
  return folder_->path() + "/" + token_file_name(address_, name_);
}

void TokenStore::keep(const std::string& address, const std::vector<std::byte>& token) {
  if (!enabled()) return;
  kept_ = false;
  if (file_.is_open() && address_ != address) forget();
  if (!open(address, true)) return;
  const auto record = write_token_record({address, name_, token});
  kept_ = record && file_.write(*record);
  if (kept_) {
    fault_ = std::exchange(unused_, {});
    return;
  }
  fault_ = "the session token is not kept over a crash: " + path() + " cannot be written";
  forget();
}

void TokenStore::forget() {
  if (file_.is_open()) file_.remove(*folder_, token_file_name(address_, name_));
  kept_ = false;
}

void TokenStore::rename(std::string name) {
  forget();
  fault_.clear();
  name_ = std::move(name);
}

void TokenStore::release() {
  file_.close();
  kept_ = false;
}

bool TokenStore::open(const std::string& address, bool made) {
  if (!enabled()) return false;
  if (file_.is_open() && address_ == address) return true;
  file_.close();
  if (folder_ == nullptr || !folder_->fault().empty()) folder_ = std::make_unique<PrivateFolder>();
  if (!folder_->fault().empty()) {
    fault_ = "the session token is not kept over a crash: " + folder_->fault();
    return false;
  }
  const LockedFile::State state = file_.open(*folder_, token_file_name(address, name_), made);
  address_ = address;
  if (state == LockedFile::State::in_use) {
    fault_ =
        "the session token is not kept over a crash: another node of that name keeps its own in " +
        path();
  } else if (state == LockedFile::State::refused) {
    fault_ = "the session token is not kept over a crash: " + path() +
             " is another user's, open to others, or no file; remove it";
  }
  return state == LockedFile::State::open;
}

}  // namespace gimnet::nif
