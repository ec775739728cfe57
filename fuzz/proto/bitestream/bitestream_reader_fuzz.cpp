// Any bytes as a Bitestream: every value lies within them, checking and walking agree, a look-up
// finds the first, and numbers convert as exact arithmetic says. Input: a Bitestream.

#include <cstddef>
#include <cstdint>
#include <span>

#include "fuzz/support/fuzz_input.hpp"
#include "proto/bitestream/reader.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::proto::bitestream;
using Bytes = std::span<const std::byte>;

/// Wide enough to hold every number of every type exactly.
static_assert(__LDBL_MANT_DIG__ >= 64);

template <class T>
long double exact(const Value& value) {
  const auto number = value.as<T>();
  return number ? static_cast<long double>(*number) : 0.0L;
}

/// Two types that both take the number agree on it.
void check_number(const Value& value) {
  const auto u64 = value.as<std::uint64_t>();
  const auto i64 = value.as<std::int64_t>();
  const auto f64 = value.as<double>();
  const auto f32 = value.as<float>();
  const auto u8 = value.as<std::uint8_t>();
  FUZZ_MUST(!u64 || !i64 || exact<std::uint64_t>(value) == exact<std::int64_t>(value));
  FUZZ_MUST(!u64 || !f64 || exact<std::uint64_t>(value) == exact<double>(value));
  FUZZ_MUST(!i64 || !f64 || exact<std::int64_t>(value) == exact<double>(value));
  FUZZ_MUST(!f32 || !f64 || *f64 != *f64 || exact<float>(value) == exact<double>(value));
  FUZZ_MUST(u8.has_value() == (u64 && *u64 <= 255));
  FUZZ_MUST(!is_number(value.type()) || u64 || i64 || f64);
}

void check_value(Bytes bytes, const Value& value) {
  const Bytes inside = value.bytes();
  FUZZ_MUST(!inside.empty() && inside.data() >= bytes.data());
  FUZZ_MUST(inside.data() + inside.size() <= bytes.data() + bytes.size());
  check_number(value);
  const std::size_t count = value.count();
  FUZZ_MUST(!value.element(count));
  for (std::size_t i = 0; i < count && i < 4; ++i) check_number(*value.element(i));
  FUZZ_MUST(value.as_text().has_value() <= (value.type() == BITESTREAM_TEXT));
}

/// Walks everything; recursion is bounded, because a reader at the largest depth gives no nested
/// value.
bool walk(Bytes bytes, Reader reader, unsigned depth) {
  FUZZ_MUST(depth <= BITESTREAM_DEPTH_MAX);
  bool valid = true;
  while (const auto value = reader.next()) {
    check_value(bytes, *value);
    const auto found = reader.find(value->key());
    FUZZ_MUST(found && found->bytes().data() <= value->bytes().data() &&
              found->key() == value->key());
    if (const auto nested = value->as_nested()) valid = walk(bytes, *nested, depth + 1) && valid;
    if (value->type() == BITESTREAM_TEXT) valid = value->as_text() && valid;
    if (value->type() != BITESTREAM_BOOL_ARRAY) continue;
    for (std::size_t i = 0; i < value->count(); ++i) valid = value->element(i)->as_bool() && valid;
  }
  FUZZ_MUST(!reader.next());
  return valid && !reader.failed();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > 4096) return 0;  // a look-up for each value is quadratic
  const fuzz::ExactCopy copy(fuzz::input(data, size));
  const bool valid = is_valid(copy.span());
  FUZZ_MUST(walk(copy.span(), Reader(copy.span()), 0) == valid);
  return 0;
}
