// Any sequence of calls of the writer: what it says is fine reads back equal, the same into memory
// of any size, and copying a valid stream value by value gives a valid stream of the same values.
// Input: calls, see put_next().

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "fuzz/support/fuzz_input.hpp"
#include "proto/bitestream/reader.hpp"
#include "proto/bitestream/writer.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::proto::bitestream;
using Bytes = std::span<const std::byte>;

/// One value as it should come back; for a nested stream, its beginning.
struct Entry {
  unsigned depth = 0;
  std::string key;
  Type type = BITESTREAM_OPAQUE;
  std::vector<std::byte> bytes;
  friend bool operator==(const Entry&, const Entry&) = default;
};

std::string key_text(const Key& key) {
  return key.is_text() ? "t" + std::string(key.text()) : "n" + std::to_string(key.number());
}

void list_entries(Reader reader, unsigned depth, std::vector<Entry>& entries) {
  while (const auto value = reader.next()) {
    Entry entry{depth, key_text(value->key()), value->type(), {}};
    const auto nested = value->as_nested();
    if (!nested) entry.bytes.assign(value->bytes().begin(), value->bytes().end());
    entries.push_back(std::move(entry));
    if (nested) list_entries(*nested, depth + 1, entries);
  }
  FUZZ_MUST(!reader.failed());
}

std::vector<Entry> entries_of(Bytes bytes) {
  std::vector<Entry> entries;
  list_entries(Reader(bytes), 0, entries);
  return entries;
}

/// Calls a writer, and keeps what should come back.
class Caller {
 public:
  explicit Caller(Bytes calls) : choices_(calls) {}

  void run(Writer& writer) {
    while (choices_.left()) put_next(writer);
    while (depth_ > 0) end(writer);
  }
  [[nodiscard]] std::vector<Entry> expected() const { return entries_; }

 private:
  /// A byte that chooses begin, end or a type; the key; then a size and the value's bytes, which
  /// are repeated.
  void put_next(Writer& writer) {
    const std::uint32_t choice = choices_.below(40);
    if (choice >= 36) return end(writer);
    const std::string text(1 + choices_.below(3), static_cast<char>('a' + choices_.below(3)));
    const Key key = choices_.below(2) == 0 ? Key(choices_.byte()) : Key(std::string_view(text));
    if (choice >= 32) return begin(writer, key);
    const auto type = static_cast<Type>(choice);
    if (!is_known_type(choice) || type == BITESTREAM_NESTED) return;
    put(writer, key, type, value(type));
  }

  std::vector<std::byte> value(Type type) {
    const std::size_t unit = std::max<std::size_t>(unit_size(type), 1);
    const bool fixed = unit_size(type) != 0 && !is_array(type);
    const std::size_t wanted = std::size_t{choices_.byte()} * (choices_.byte() == 255 ? 300 : 1);
    const std::size_t count = fixed ? 1 : std::min(wanted, left_ / unit);
    left_ -= std::min(left_, unit * count);
    const auto pattern = choices_.bytes(8);
    std::vector<std::byte> bytes(unit * count, std::byte{0});
    const bool plain = element_type(type) == BITESTREAM_BOOL || type == BITESTREAM_TEXT;
    for (std::size_t i = 0; i < bytes.size() && !pattern.empty(); ++i) {
      bytes[i] =
          pattern[i % pattern.size()] & std::byte{static_cast<unsigned char>(plain ? 1 : 255)};
    }
    return bytes;
  }

  void put(Writer& writer, Key key, Type type, const std::vector<std::byte>& bytes) {
    writer.put_value(key, type, bytes);
    if (!bytes.empty()) entries_.push_back({depth_, key_text(key), type, bytes});
  }
  void begin(Writer& writer, Key key) {
    if (depth_ == BITESTREAM_DEPTH_MAX) return;
    writer.begin_nested(key);
    entries_.push_back({depth_++, key_text(key), BITESTREAM_NESTED, {}});
  }
  void end(Writer& writer) {
    if (depth_ == 0) return;
    writer.end_nested();
    --depth_;
    // A nested stream without values is left out.
    if (entries_.back().type == BITESTREAM_NESTED && entries_.back().depth == depth_)
      entries_.pop_back();
  }

  fuzz::Choices choices_;
  unsigned depth_ = 0;
  std::size_t left_ = 70'000;  ///< bytes of values: just enough for a length of 4 bytes
  std::vector<Entry> entries_;
};

void copy_values(Reader from, Writer& to) {
  while (const auto value = from.next()) {
    if (const auto nested = value->as_nested()) {
      to.begin_nested(value->key());
      copy_values(*nested, to);
      to.end_nested();
    } else {
      to.put_value(value->key(), value->type(), value->bytes());
    }
  }
}

void check_calls(Bytes calls) {
  Caller caller(calls);
  Writer writer;
  caller.run(writer);
  FUZZ_MUST(writer.finish() == BITESTREAM_OK);
  const fuzz::ExactCopy written(writer.bytes());
  FUZZ_MUST(is_valid(written.span()));
  FUZZ_MUST(entries_of(written.span()) == caller.expected());

  // A nested stream that is left out in the end needs room for its label until then.
  constexpr std::size_t kLabels = 16 * std::size_t{BITESTREAM_DEPTH_MAX};
  for (const std::size_t size : {writer.size() + kLabels, writer.size() / 2}) {
    std::vector<std::byte> memory(size);
    Writer fixed{std::span(memory)};
    Caller(calls).run(fixed);
    const bool fits = fixed.finish() == BITESTREAM_OK;
    FUZZ_MUST(fits || (fixed.finish() == BITESTREAM_NO_ROOM && size < writer.size() + kLabels));
    FUZZ_MUST(!fits || fuzz::same(fixed.bytes(), writer.bytes()));
  }
}

void check_copy(Bytes bytes) {
  if (!is_valid(bytes)) return;
  Writer writer;
  copy_values(Reader(bytes), writer);
  FUZZ_MUST(writer.finish() == BITESTREAM_OK && writer.size() <= bytes.size());
  FUZZ_MUST(entries_of(writer.bytes()) == entries_of(bytes));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const Bytes bytes = fuzz::input(data, size);
  check_calls(bytes.first(std::min<std::size_t>(size, 512)));
  check_copy(bytes);
  return 0;
}
