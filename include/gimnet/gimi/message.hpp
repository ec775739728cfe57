#pragma once

#include <compare>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "gimnet/gimi/namespace.hpp"
#include "gimnet/gimi_message.h"

namespace gimnet::inline GIMNET_GIMI_NAMESPACE {

/// A node as others address it: hub << 20 | index, printed `7.17`. 0 is nobody. A value type.
struct Peer {
  std::uint32_t id = 0;

  [[nodiscard]] explicit operator bool() const { return id != 0; }
  /// `7.17`
  [[nodiscard]] std::string text() const {
    return std::to_string(id >> kIndexBits) + "." + std::to_string(id & kIndexMax);
  }
  /// Reads `7.17`; nothing for other text.
  [[nodiscard]] static std::optional<Peer> parse(std::string_view text) {
    const auto point = text.find('.');
    if (point == std::string_view::npos) return std::nullopt;
    const auto hub = number(text.substr(0, point), UINT32_MAX >> kIndexBits);
    const auto index = number(text.substr(point + 1), kIndexMax);
    if (!hub || !index) return std::nullopt;
    return Peer{(*hub << kIndexBits) | *index};
  }
  friend constexpr auto operator<=>(const Peer&, const Peer&) = default;

 private:
  static constexpr unsigned kIndexBits = 20;
  static constexpr std::uint32_t kIndexMax = (1u << kIndexBits) - 1;
  [[nodiscard]] static std::optional<std::uint32_t> number(std::string_view text,
                                                           std::uint32_t max) {
    std::uint64_t value = 0;
    for (const char digit : text) {
      if (digit < '0' || digit > '9') return std::nullopt;
      value = value * 10 + static_cast<unsigned>(digit - '0');
      if (value > max) return std::nullopt;
    }
    if (text.empty()) return std::nullopt;
    return static_cast<std::uint32_t>(value);
  }
};

/// The kind of a message: it selects a queue of the receiver. The numbers, any of 32 bits, are
/// the application's.
struct MessageKey {
  std::uint32_t type = 0;
  std::uint32_t instance = 0;
  friend constexpr auto operator<=>(const MessageKey&, const MessageKey&) = default;
};

/// A lower lane goes first at every queue; there is no order between lanes.
enum class Lane : std::uint8_t { real_time = 0, normal = 1, bulk = 2, background = 3 };
[[nodiscard]] constexpr gimi_lane lane_number(Lane lane) {
  return static_cast<gimi_lane>(lane) + 1;
}

/// Bytes to send, looked at and never kept: text, or any contiguous range of bytes or characters.
class BytesView {
 public:
  BytesView() = default;
  BytesView(const char* text) : BytesView(std::string_view{text}) {}
  BytesView(std::string_view text)
      : data_(reinterpret_cast<const std::byte*>(text.data())), size_(text.size()) {}
  BytesView(const std::string& text) : BytesView(std::string_view{text}) {}
  template <class Range>
    requires(!std::convertible_to<const Range&, std::string_view>) && requires(const Range& range) {
      std::as_bytes(std::span{range.data(), range.size()});
      requires sizeof(*range.data()) == 1;
    }
  BytesView(const Range& range)
      : data_(reinterpret_cast<const std::byte*>(range.data())), size_(range.size()) {}

  [[nodiscard]] const std::byte* data() const { return data_; }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::span<const std::byte> span() const { return {data_, size_}; }

 private:
  const std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

/// The age of a message, in ns. `error_ns` is this node's part of the error: half of its shortest
/// round trip to its hub. The sender has a part like that, and each link.
struct MessageAge {
  std::int64_t age_ns = 0;
  std::int64_t error_ns = 0;
};

/// A message that was received. Owns its bytes, which stay where the network put them; it may share
/// a block of 256 KiB with its neighbours, so a program that keeps few of many for long copies
/// those. Thread safety: a value that can be moved; one thread at a time. Lifetime: may outlive the
/// node.
class Message {
 public:
  Message() = default;
  /// Takes over what the library gave out.
  explicit Message(const gimi_message& taken) : message_(taken) {}
  Message(Message&& other) noexcept : message_(other.give_up()) {}
  Message& operator=(Message&& other) noexcept {
    Message old(std::move(other));
    std::swap(message_, old.message_);
    return *this;
  }
  Message(const Message&) = delete;
  Message& operator=(const Message&) = delete;
  ~Message() {
    if (message_.storage != nullptr || message_.name_storage != nullptr)
      gimi_message_release(&message_);
  }

  /// Valid until: this message is destroyed or moved from.
  [[nodiscard]] std::span<const std::byte> data() const {
    return {static_cast<const std::byte*>(message_.data), message_.size};
  }
  [[nodiscard]] std::string_view text() const {
    return {static_cast<const char*>(message_.data), message_.size};
  }
  [[nodiscard]] std::size_t size() const { return message_.size; }

  /// Its sender: the first hub vouches for it.
  [[nodiscard]] Peer from() const { return {message_.from}; }
  [[nodiscard]] MessageKey key() const { return {message_.key.type, message_.key.instance}; }
  [[nodiscard]] Lane lane() const { return static_cast<Lane>(message_.lane - 1); }
  /// Counted by the sender for each (destination, key) from 1, and by a publisher for all its
  /// subscribers; after 2^32 - 1 comes 0.
  [[nodiscard]] std::uint32_t sequence() const { return message_.sequence; }
  /// Its sender has begun the stream anew since the message before it: the sender is another
  /// process under the same id, say after `kill -9`. sequence() counts anew, and nothing was
  /// missed.
  [[nodiscard]] bool begins_stream() const { return has(GIMI_BEGINS_STREAM); }
  /// It was sent with NIF without a GIMI header: sequence() is 0, and so are type and instance of
  /// key().
  [[nodiscard]] bool plain() const { return has(GIMI_PLAIN); }
  /// It was published with Delivery::latest: gaps in sequence() are what was skipped for newer
  /// ones.
  [[nodiscard]] bool latest() const { return has(GIMI_OF_LATEST); }
  /// When it was sent, by the sender's clock in ns since 1970, if the sender stamped it.
  [[nodiscard]] std::optional<std::int64_t> sent_ns() const {
    return has(GIMI_STAMPED) ? std::optional(message_.sent_ns) : std::nullopt;
  }
  /// The time since it was sent, by the clocks of the hubs, if it was sent with an age limit
  /// (PublishOptions::age_ms_max). Nothing: not known (gimi_message_age()).
  [[nodiscard]] std::optional<MessageAge> age() const {
    if (!has(GIMI_AGED)) return std::nullopt;
    MessageAge age;
    static_cast<void>(gimi_message_age(&message_, &age.age_ns, &age.error_ns));
    return age;
  }
  /// When it was read from the network, by this machine's clock in ns since 1970.
  [[nodiscard]] std::int64_t arrival_ns() const { return message_.arrival_ns; }
  /// NodeState::reconnects of its node when it came: if it grows from one message to the next, the
  /// connection to the hub was broken between them.
  [[nodiscard]] std::uint32_t reconnects() const { return message_.reconnects; }
  /// Full name of the service that published it, or of the own service to which it was sent; "" for
  /// one that was sent to this node.
  [[nodiscard]] std::string_view service() const {
    return message_.service != nullptr ? message_.service : "";
  }

  /// As the C functions have it; it stays this message's.
  [[nodiscard]] const gimi_message& c_message() const { return message_; }
  /// The same, which is the caller's from then on, to release; this message is empty.
  [[nodiscard]] gimi_message give_up() noexcept { return std::exchange(message_, {}); }

 private:
  [[nodiscard]] bool has(std::uint32_t flag) const { return (message_.flags & flag) != 0; }

  gimi_message message_{};
};

}  // namespace gimnet::inline GIMNET_GIMI_NAMESPACE
