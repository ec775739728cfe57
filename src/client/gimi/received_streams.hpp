#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <map>

#include "gimnet/gimi/message.hpp"

namespace gimnet::gimi {

/// The epochs of one received stream: the current one and the last ones that it replaced
/// (docs/protocol.md, section 7). A value type.
class StreamEpochs {
 public:
  /// Replaced epochs that are remembered: a sender that is started again more often than this
  /// while one of its messages is under way does not exist.
  static constexpr std::size_t kFormerMax = 8;

  enum class Step : std::uint8_t {
    first,    ///< nothing came of this stream before
    goes_on,  ///< of the current epoch
    begins,   ///< of an epoch that replaces the current one
    former,   ///< of an epoch that was replaced: drop it
  };
  /// Tells what a message of that epoch would be. Changes nothing.
  [[nodiscard]] Step look(std::uint32_t epoch) const;
  /// The message was taken: its epoch is the current one. REQUIRES: look() is not `former`.
  void take(std::uint32_t epoch);

 private:
  std::array<std::uint32_t, kFormerMax> former_{};
  std::uint32_t current_ = 0;
  std::uint8_t formers_ = 0;  ///< used places of former_
  std::uint8_t oldest_ = 0;   ///< the place to use next, once all are
  bool any_ = false;
};

/// A received stream of DATA. Group frames have streams of their own (SubscribedService).
struct ReceivedStreamName {
  Peer from;
  std::uint8_t kind = 0;
  std::uint32_t group = 0;  ///< of an own service that accepts; else 0
  MessageKey key;
  friend auto operator<=>(const ReceivedStreamName&, const ReceivedStreamName&) = default;
};

/// The epochs of all streams that other nodes send to this one. In the order of streams, which no
/// choice of keys can make slow. Thread safety: the library's thread. Limits: `kStreamsMax`
/// streams; beyond them a stream next to the new one is forgotten, mostly of the same sender.
class ReceivedStreams {
 public:
  static constexpr std::size_t kStreamsMax = 65'536;

  /// Valid until: the next call.
  [[nodiscard]] StreamEpochs& find(const ReceivedStreamName& name);
  [[nodiscard]] std::size_t size() const { return streams_.size(); }

 private:
  std::map<ReceivedStreamName, StreamEpochs> streams_;
};

}  // namespace gimnet::gimi
