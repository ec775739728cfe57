#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "proto/bitestream/reader.hpp"
#include "proto/bitestream/writer.hpp"

namespace gimnet::proto {

inline constexpr std::uint32_t kStatusKey = 1;
inline constexpr std::uint32_t kSentenceKey = 2;
inline constexpr std::uint32_t kLearningKey = 5;

inline constexpr std::size_t kSentenceBytesMax = 1024;
/// So many bytes of a name or pattern are written at most. That is more than any may have, so a
/// name that is too long is refused and not cut to another one.
inline constexpr std::size_t kWrittenNameBytesMax = 1024;
inline constexpr std::size_t kDescriptionBytesMax = 256;
inline constexpr std::size_t kTokenBytesMax = 128;
inline constexpr std::size_t kMetadataBytesMax = 4096;
/// For texts that only people read, as the place of a peer or a version.
inline constexpr std::size_t kRemarkBytesMax = 256;

/// Writes a text so that every reader takes it: cut to `bytes_max` between two characters, and with
/// '?' for each byte that is not UTF-8. Texts may come from users of the library and from peers,
/// and must not break the message.
void put_clean_text(bitestream::Writer& writer, bitestream::Key key, std::string_view text,
                    std::size_t bytes_max);

/// The values of a control message by key. The whole body is checked when it is constructed; the
/// first thing that is wrong, there or in a later call, is kept as a sentence, and every call after
/// it gives the fallback. Thread safety: one thread. Valid until: the body changes. Cost: one pass
/// over the body, then O(1) a key.
class Fields {
 public:
  /// Keys from here on are not looked at: no message has them.
  static constexpr std::uint32_t kKeysEnd = 32;

  /// `message` names the message in sentences and must outlive this.
  Fields(std::span<const std::byte> body, const char* message);

  [[nodiscard]] bool has(std::uint32_t key) const { return value(key) != nullptr; }

  template <bitestream::Number T>
  [[nodiscard]] T number(std::uint32_t key, const char* name, T fallback) {
    const bitestream::Value* found = value(key);
    if (found == nullptr) return fallback;
    const auto number = found->as<T>();
    if (!number) fail_type(name, "a number that fits");
    return number.value_or(fallback);
  }
  template <bitestream::Number T>
  [[nodiscard]] T required_number(std::uint32_t key, const char* name) {
    require(key, name);
    return number<T>(key, name, T{0});
  }
  [[nodiscard]] bool flag(std::uint32_t key, const char* name, bool fallback);
  /// Nanoseconds since 1970; 0 where it is absent.
  [[nodiscard]] std::int64_t time(std::uint32_t key, const char* name);
  /// Empty where it is absent.
  [[nodiscard]] std::string text(std::uint32_t key, const char* name, std::size_t bytes_max);
  [[nodiscard]] std::string required_text(std::uint32_t key, const char* name,
                                          std::size_t bytes_max);
  [[nodiscard]] std::vector<std::byte> opaque(std::uint32_t key, const char* name,
                                              std::size_t bytes_max);

  /// Calls `read(Fields&)` for each nested value with that key, in order, and keeps what it
  /// returns.
  template <class Record, class Read>
  [[nodiscard]] std::vector<Record> records(std::uint32_t key, const char* name, Read read) {
    std::vector<Record> found;
    bitestream::Reader reader(body_);
    while (const auto next = reader.next()) {
      if (failed()) break;
      if (!(next->key() == bitestream::Key(key))) continue;
      if (next->type() != BITESTREAM_NESTED) {
        fail_type(name, "nested");
        break;
      }
      Fields record(next->bytes(), message_);
      found.push_back(read(record));
      if (record.failed()) error_ = record.error_;
    }
    return found;
  }
  /// The values inside, for messages that have keys of another kind.
  [[nodiscard]] bitestream::Reader reader() const { return bitestream::Reader(body_); }

  void fail(std::string_view clause);
  [[nodiscard]] bool failed() const { return error_.has_value(); }
  /// REQUIRES: failed().
  [[nodiscard]] const Error& error() const { return *error_; }

 private:
  [[nodiscard]] const bitestream::Value* value(std::uint32_t key) const;
  void require(std::uint32_t key, const char* name);
  void fail_type(const char* name, const char* wanted);
  bool fits(const char* name, std::size_t size, std::size_t bytes_max);

  std::span<const std::byte> body_;
  const char* message_;
  std::array<std::optional<bitestream::Value>, kKeysEnd> values_;
  std::optional<Error> error_;
};

}  // namespace gimnet::proto
