#pragma once

#include <compare>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

namespace gimnet {

/// A node as others address it: hub << 20 | index, printed `7.17`. 0 is nobody. A value type.
struct Peer {
  std::uint32_t id = 0;

  [[nodiscard]] explicit operator bool() const { return id != 0; }
  /// `7.17`
  [[nodiscard]] std::string text() const;
  /// Reads `7.17`; nothing for other text.
  [[nodiscard]] static std::optional<Peer> parse(std::string_view text);
  friend constexpr auto operator<=>(const Peer&, const Peer&) = default;
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

/// A message that was received. Owns its bytes, which stay where the network put them; it may share
/// a block of 256 KiB with its neighbours, so a program that keeps few of many for long copies
/// those. Thread safety: a value that can be moved; one thread at a time. Lifetime: may outlive the
/// node.
class Message {
 public:
  Message() = default;
  Message(Message&& other) noexcept { swap(other); }
  Message& operator=(Message&& other) noexcept {
    Message old(std::move(other));
    swap(old);
    return *this;
  }
  Message(const Message&) = delete;
  Message& operator=(const Message&) = delete;
  ~Message();

  /// Valid until: this message is destroyed or moved from.
  [[nodiscard]] std::span<const std::byte> data() const { return data_; }
  [[nodiscard]] std::string_view text() const {
    return {reinterpret_cast<const char*>(data_.data()), data_.size()};
  }
  [[nodiscard]] std::size_t size() const { return data_.size(); }

  /// Its sender: the first hub vouches for it.
  [[nodiscard]] Peer from() const { return from_; }
  [[nodiscard]] MessageKey key() const { return key_; }
  [[nodiscard]] Lane lane() const { return lane_; }
  /// Counted by the sender for each (destination, key) from 1, and by a publisher for all its
  /// subscribers; after 2^32 - 1 comes 0.
  [[nodiscard]] std::uint32_t sequence() const { return sequence_; }
  /// Its sender has begun the stream anew since the message before it: the sender is another
  /// process under the same id, say after `kill -9`. sequence() counts anew, and nothing was
  /// missed.
  [[nodiscard]] bool begins_stream() const { return begins_stream_; }
  /// It was sent with NIF without a GIMI header: sequence() is 0, and so are type and instance of
  /// key().
  [[nodiscard]] bool plain() const { return plain_; }
  /// It was published with Delivery::latest: gaps in sequence() are what was skipped for newer
  /// ones.
  [[nodiscard]] bool latest() const { return latest_; }
  /// When it was sent, by the sender's clock in ns since 1970, if the sender stamped it.
  [[nodiscard]] std::optional<std::int64_t> sent_ns() const { return sent_ns_; }
  /// When it was read from the network, by this machine's clock in ns since 1970.
  [[nodiscard]] std::int64_t arrival_ns() const { return arrival_ns_; }
  /// NodeState::reconnects of its node when it came: if it grows from one message to the next, the
  /// connection to the hub was broken between them.
  [[nodiscard]] std::uint32_t reconnects() const { return reconnects_; }
  /// Full name of the service it was published by; "" for one that was sent to this node.
  [[nodiscard]] std::string_view service() const {
    return service_ ? std::string_view{*service_} : "";
  }

 private:
  friend struct MessageAccess;
  void swap(Message& other) noexcept;

  std::span<const std::byte> data_;
  void* storage_ = nullptr;
  std::shared_ptr<const std::string> service_;
  std::optional<std::int64_t> sent_ns_;
  std::int64_t arrival_ns_ = 0;
  Peer from_;
  MessageKey key_;
  std::uint32_t sequence_ = 0;
  std::uint32_t reconnects_ = 0;
  Lane lane_ = Lane::normal;
  bool begins_stream_ = false;
  bool plain_ = false;
  bool latest_ = false;
  std::uint32_t group_ = 0;
  std::uint32_t epoch_ = 0;  ///< of a message that counts in a window
};

}  // namespace gimnet
