#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tests/sim/agenda.hpp"

namespace gimnet::sim {

/// Everything that happens, as a hash of all of it and the last of it in words. Equal seeds have
/// equal hashes on every run and with every compiler: no addresses, no real time, no order of a
/// hash table enters it. Thread safety: none.
class Trace {
 public:
  explicit Trace(const Agenda& agenda, bool print)
      : agenda_(agenda), print_(print), last_(kLastEvents) {}

  /// `words` in which {a}, {b}, {c} and {t} stand for what follows. Lifetime: `words` is a literal.
  void note(const char* words, std::uint64_t a = 0, std::uint64_t b = 0, std::uint64_t c = 0,
            std::string_view text = {});
  /// Adds bytes to the hash, without words.
  void mix(std::span<const std::byte> bytes);

  [[nodiscard]] std::uint64_t hash() const { return hash_; }
  [[nodiscard]] std::uint64_t events() const { return events_; }
  /// The last events in words, oldest first.
  [[nodiscard]] std::vector<std::string> last() const;

 private:
  struct Entry {
    Time time{};
    std::uint64_t number = 0;
    const char* words = "";
    std::uint64_t a = 0;
    std::uint64_t b = 0;
    std::uint64_t c = 0;
    std::string text;
  };
  static constexpr std::size_t kLastEvents = 24;
  static std::string in_words(const Entry& entry);
  void mix(std::uint64_t word);

  const Agenda& agenda_;
  const bool print_;
  std::uint64_t hash_ = 0x2545F4914F6CDD1D;
  std::uint64_t events_ = 0;
  std::vector<Entry> last_;  ///< a ring
};

}  // namespace gimnet::sim
