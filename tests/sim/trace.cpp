#include "tests/sim/trace.hpp"

#include <algorithm>
#include <bit>
#include <cstdio>
#include <cstring>

#include "base/log.hpp"

namespace gimnet::sim {

void Trace::mix(std::uint64_t word) {
  hash_ = std::rotl(hash_ ^ word, 29) * 0x9FB21C651E98DF25u;
  hash_ ^= hash_ >> 32;
}

void Trace::mix(std::span<const std::byte> bytes) {
  mix(bytes.size());
  while (!bytes.empty()) {
    std::uint64_t word = 0;
    const std::size_t size = std::min(bytes.size(), sizeof word);
    std::memcpy(&word, bytes.data(), size);  // little-endian on every machine that this builds for
    mix(word);
    bytes = bytes.subspan(size);
  }
}

void Trace::note(const char* words, std::uint64_t a, std::uint64_t b, std::uint64_t c,
                 std::string_view text) {
  Entry& entry = last_[events_ % last_.size()];
  entry.time = agenda_.now();
  entry.number = ++events_;
  entry.words = words;
  entry.a = a;
  entry.b = b;
  entry.c = c;
  entry.text.assign(text);
  mix(static_cast<std::uint64_t>(entry.time.count()));
  mix(std::as_bytes(std::span{words, std::strlen(words)}));
  mix(a);
  mix(b);
  mix(c);
  mix(std::as_bytes(std::span{text}));
  if (print_) std::printf("%s\n", in_words(entry).c_str());
}

std::string Trace::in_words(const Entry& entry) {
  char head[64];
  std::snprintf(head, sizeof head, "%7llu %10.3f ms  ",
                static_cast<unsigned long long>(entry.number),
                static_cast<double>(entry.time.count()) / 1'000);
  std::string line = head;
  for (const char* next = entry.words; *next != '\0'; ++next) {
    if (next[0] != '{' || next[1] == '\0' || next[2] != '}') {
      line += *next;
      continue;
    }
    switch (next[1]) {
      case 'a':
        line += std::to_string(entry.a);
        break;
      case 'b':
        line += std::to_string(entry.b);
        break;
      case 'c':
        line += std::to_string(entry.c);
        break;
      default:
        line += escaped(entry.text, 200);
    }
    next += 2;
  }
  return line;
}

std::vector<std::string> Trace::last() const {
  std::vector<std::string> lines;
  const std::uint64_t count = std::min<std::uint64_t>(events_, last_.size());
  for (std::uint64_t i = events_ - count; i < events_; ++i)
    lines.push_back(in_words(last_[i % last_.size()]));
  return lines;
}

}  // namespace gimnet::sim
