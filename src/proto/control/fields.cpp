#include "proto/control/fields.hpp"

#include <algorithm>

#include "proto/bitestream/utf8.hpp"

namespace gimnet::proto {
namespace {

constexpr std::size_t kCharacterBytesMax = 4;

/// Bytes of the character that `text` begins with; 0: it does not begin with one.
std::size_t character_size(std::string_view text) {
  const auto* bytes = reinterpret_cast<const unsigned char*>(text.data());
  for (std::size_t size = 1; size <= kCharacterBytesMax && size <= text.size(); ++size) {
    if (bitestream::valid_utf8(bytes, size)) return size;
  }
  return 0;
}

}  // namespace

void put_clean_text(bitestream::Writer& writer, bitestream::Key key, std::string_view text,
                    std::size_t bytes_max) {
  std::string clean;
  while (!text.empty()) {
    const std::size_t size = character_size(text);
    if (clean.size() + std::max<std::size_t>(size, 1) > bytes_max) break;
    if (size == 0) {
      clean += '?';
    } else {
      clean.append(text.substr(0, size));
    }
    text.remove_prefix(std::max<std::size_t>(size, 1));
  }
  writer.put_text(key, clean);
}

Fields::Fields(std::span<const std::byte> body, const char* message)
    : body_(body), message_(message) {
  if (!bitestream::is_valid(body)) {
    fail("is not a valid Bitestream");
    return;
  }
  bitestream::Reader reader(body);
  while (const auto next = reader.next()) {
    const bitestream::Key key = next->key();
    if (key.is_text() || key.number() >= kKeysEnd) continue;
    auto& slot = values_[key.number()];
    if (!slot) slot = *next;
  }
}

const bitestream::Value* Fields::value(std::uint32_t key) const {
  GIMNET_ASSERT(key < kKeysEnd);
  return failed() || !values_[key] ? nullptr : &*values_[key];
}

bool Fields::flag(std::uint32_t key, const char* name, bool fallback) {
  const bitestream::Value* found = value(key);
  if (found == nullptr) return fallback;
  const auto flag = found->as_bool();
  if (!flag) fail_type(name, "a bool");
  return flag.value_or(fallback);
}

std::int64_t Fields::time(std::uint32_t key, const char* name) {
  const bitestream::Value* found = value(key);
  if (found == nullptr) return 0;
  const auto time = found->as_time();
  if (!time) fail_type(name, "a time");
  return time.value_or(0);
}

std::string Fields::text(std::uint32_t key, const char* name, std::size_t bytes_max) {
  const bitestream::Value* found = value(key);
  if (found == nullptr) return {};
  const auto text = found->as_text();
  if (!text) {
    fail_type(name, "text");
    return {};
  }
  return fits(name, text->size(), bytes_max) ? std::string(*text) : std::string();
}

std::string Fields::required_text(std::uint32_t key, const char* name, std::size_t bytes_max) {
  require(key, name);
  return text(key, name, bytes_max);
}

std::vector<std::byte> Fields::opaque(std::uint32_t key, const char* name, std::size_t bytes_max) {
  const bitestream::Value* found = value(key);
  if (found == nullptr) return {};
  const auto bytes = found->as_opaque();
  if (!bytes) {
    fail_type(name, "opaque");
    return {};
  }
  if (!fits(name, bytes->size(), bytes_max)) return {};
  return {bytes->begin(), bytes->end()};
}

void Fields::fail(std::string_view clause) {
  if (!error_) error_ = Error{std::string(message_).append(" ").append(clause)};
}

void Fields::require(std::uint32_t key, const char* name) {
  if (!failed() && !has(key))
    fail("has no " + std::string(name) + " (key " + std::to_string(key) + ")");
}

void Fields::fail_type(const char* name, const char* wanted) {
  fail("has a " + std::string(name) + " that is not " + wanted);
}

bool Fields::fits(const char* name, std::size_t size, std::size_t bytes_max) {
  if (size <= bytes_max) return true;
  fail("has a " + std::string(name) + " of " + std::to_string(size) + " bytes; at most " +
       std::to_string(bytes_max) + " are allowed");
  return false;
}

}  // namespace gimnet::proto
