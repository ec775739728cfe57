#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hub/shard/commands.hpp"
#include "proto/control/link.hpp"
#include "proto/frame/flow.hpp"
#include "proto/frame/frame_header.hpp"
#include "proto/frame/report.hpp"
#include "tests/support/memory_stream.hpp"

namespace gimnet::hub::testing {

/// A frame as a node got it.
struct GotFrame {
  proto::FrameHeader header;
  std::vector<std::byte> body;  ///< everything after the header
  [[nodiscard]] std::string text() const {
    return {reinterpret_cast<const char*>(body.data()), body.size()};
  }
};

/// A node played by a test: the far end of its connection, and what came out of it.
struct FakeNode {
  NodeId id;
  ShardIndex shard;
  SessionRef session;
  std::uint32_t attachment = 0;
  MemoryPeer pipe;
  std::vector<std::byte> stream;   ///< read and not taken apart yet
  bool opened = false;             ///< the 8 opening bytes came
  std::vector<GotFrame> frames;    ///< data frames
  std::vector<GotFrame> control;   ///< FLOW, LINK, NS, CTRL and REPORT
  std::vector<proto::Kind> kinds;  ///< of both, as they came
  std::uint64_t data_frames = 0;   ///< of this epoch, SKIP included
  std::uint64_t skipped = 0;
  std::optional<proto::Welcome> welcome;
  std::optional<proto::Goodbye> goodbye;

  /// Takes everything that the hub sent (or `most` bytes of it) apart.
  void read(std::size_t most = MemoryPeer::kAll);
  [[nodiscard]] std::vector<std::string> texts() const;
  [[nodiscard]] std::vector<proto::flow::Message> flow() const;
  template <class Message>
  [[nodiscard]] std::vector<Message> flow_of() const {
    std::vector<Message> found;
    for (const proto::flow::Message& message : flow()) {
      if (const auto* match = std::get_if<Message>(&message)) found.push_back(*match);
    }
    return found;
  }
  [[nodiscard]] std::vector<proto::Report> reports() const;

 private:
  void on_frame(const GotFrame& frame);
};

}  // namespace gimnet::hub::testing
