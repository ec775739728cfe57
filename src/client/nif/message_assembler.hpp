#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "client/nif/storage.hpp"
#include "client/nif/window_tuning.hpp"
#include "proto/frame/frame_parser.hpp"
#include "proto/frame/reassembler.hpp"
#include "proto/frame/taken.hpp"
#include "proto/frame/window.hpp"

namespace gimnet::nif {

/// The first byte of the application in a payload of `size` bytes that begins as this frame's does.
[[nodiscard]] std::size_t data_begin(const proto::FrameView& view, std::uint32_t size);

/// Fragments in, whole messages and TAKENs out: proto's Reassembler with a receive window for each
/// large UNICAST message. Thread safety: one thread. Memory: within the limits, whatever a peer
/// claims.
class MessageAssembler {
 public:
  explicit MessageAssembler(const proto::ReassemblyLimits& limits)
      : limits_(limits), reassembler_(limits) {}

  /// Memory for large messages, to which their records give it back.
  [[nodiscard]] const std::shared_ptr<SpareBuffers>& spares() const { return spares_; }

  /// The news for the sender of a message.
  struct Notice {
    std::uint32_t to = 0;
    proto::Taken taken;
  };
  struct Step {
    proto::Reassembled reassembled;
    std::optional<Notice> notice;
  };
  /// `now_ns`: steady_now_ns() when it was read. REQUIRES: view.fragment.
  [[nodiscard]] Step take(const proto::FrameView& view, std::int64_t now_ns);

  /// The present progress of the sender's large messages; of nobody: of those of all senders. For
  /// TAKENs that could not be sent when they were due.
  [[nodiscard]] std::vector<Notice> notices_again(std::optional<NodeId> sender);

  /// A frame without fragment header came in that stream. Returns messages lost by it.
  [[nodiscard]] std::uint32_t interrupt(const proto::FrameHeader& header) {
    if (reassembler_.open_messages() == 0) return 0;
    return reassembler_.interrupt(proto::FragmentStream::of(header));
  }

  /// Everything unfinished is lost: how many messages, and whom to tell that it is in vain to go
  /// on.
  struct Lost {
    std::uint32_t messages = 0;
    std::vector<Notice> notices;
  };
  [[nodiscard]] Lost clear();

 private:
  struct OpenMessage {
    proto::ReceiveWindow progress;
    WindowTuning tuning;
  };
  [[nodiscard]] std::optional<proto::Taken> progress(const proto::FrameView& view,
                                                     std::uint32_t taken, std::int64_t now_ns);

  /// Messages that ended without a word to this end leave their windows behind.
  void forget_ended();

  const std::shared_ptr<SpareBuffers> spares_ = std::make_shared<SpareBuffers>();
  const proto::ReassemblyLimits limits_;
  proto::Reassembler reassembler_;
  std::unordered_map<std::uint64_t, OpenMessage> windows_;  ///< by sender and message number
};

}  // namespace gimnet::nif
