#pragma once

#include <concepts>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace gimnet {

/// Text that is set rarely, read rarely and kept in great number: one pointer, and nothing behind
/// it while it is empty, where a std::string takes four words. It is not changed in place. Thread
/// safety: as std::string. Limits: 4 GiB.
class CompactText {
 public:
  CompactText() = default;
  /// Implicit, as from one string to another.
  template <class Text>
    requires std::convertible_to<const Text&, std::string_view> &&
             (!std::same_as<Text, CompactText>)
  CompactText(const Text& text) {  // NOLINT(google-explicit-constructor)
    assign(text);
  }
  CompactText(const CompactText& other) { assign(other); }
  CompactText(CompactText&&) noexcept = default;
  CompactText& operator=(const CompactText& other) {
    if (this != &other) assign(other);
    return *this;
  }
  CompactText& operator=(CompactText&&) noexcept = default;
  ~CompactText() = default;

  [[nodiscard]] bool empty() const { return memory_ == nullptr; }
  /// Valid until: the text is assigned to or destroyed.
  operator std::string_view() const {  // NOLINT(google-explicit-constructor)
    if (memory_ == nullptr) return {};
    std::uint32_t size = 0;
    std::memcpy(&size, memory_.get(), sizeof size);
    return {memory_.get() + sizeof size, size};
  }
  [[nodiscard]] std::string str() const { return std::string{std::string_view{*this}}; }

  template <class Text>
    requires std::convertible_to<const Text&, std::string_view>
  friend bool operator==(const CompactText& a, const Text& b) {
    return std::string_view{a} == std::string_view{b};
  }

 private:
  void assign(std::string_view text) {
    std::unique_ptr<char[]> memory;
    if (!text.empty()) {
      const auto size = static_cast<std::uint32_t>(text.size());
      memory = std::make_unique_for_overwrite<char[]>(sizeof size + text.size());
      std::memcpy(memory.get(), &size, sizeof size);
      std::memcpy(memory.get() + sizeof size, text.data(), text.size());
    }
    memory_ = std::move(memory);
  }

  std::unique_ptr<char[]> memory_;  ///< the size, then the text; null: empty
};

}  // namespace gimnet
