#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/nif/inbound.hpp"
#include "gimnet/nif.h"
#include "proto/frame/flow.hpp"
#include "proto/frame/frame_builder.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

// The receiving half of a node without the rest of it.

namespace gimnet::nif::test {

/// Keeps everything that the receiving half hands on.
class RecordingHost final : public InboundHost {
 public:
  ~RecordingHost() {
    for (nif_incoming& in : items) nif_release(&in);
  }
  [[nodiscard]] bool on_flow(const proto::flow::Message& message) override {
    flows.push_back(message);
    return !std::holds_alternative<proto::flow::Confirm>(message);
  }
  [[nodiscard]] std::vector<Item> on_answer(proto::Kind,
                                            const proto::ControlView& answer) override {
    answers.push_back(answer.header.request);
    return {};
  }
  [[nodiscard]] bool on_service_moved(const proto::ns::ServiceMoved&) override {
    return moved_is_news;
  }
  [[nodiscard]] bool on_watch_events(const proto::ns::WatchEvents&) override { return true; }
  [[nodiscard]] bool is_own_service(const std::string&) override { return false; }
  void on_taken(std::uint32_t, const proto::Taken& taken) override {
    taken_received.push_back(taken);
  }
  bool on_report(const proto::Report&) override { return false; }
  [[nodiscard]] std::optional<ReportedMessages::Start> message_of(const proto::Report&) override {
    return start;
  }
  void send_taken(std::uint32_t, const proto::Taken& taken) override {
    taken_sent.push_back(taken);
  }
  [[nodiscard]] std::uint32_t epoch_for(std::uint32_t group) override {
    return group == counted_group ? 1 : 0;
  }
  [[nodiscard]] bool may_wait(std::uint32_t group, std::size_t bytes) override {
    return group != unwanted_group || bytes <= unwanted_bytes_max;
  }
  void on_message_lost(std::uint32_t group) override { lost_groups.push_back(group); }
  void deliver(std::span<const Item> delivered) override {
    for (const Item& item : delivered) {
      items.push_back(incoming_of(item));
      item_bytes += item.bytes;
    }
  }

  /// The payloads of all messages.
  [[nodiscard]] std::vector<std::string> texts() const {
    std::vector<std::string> found;
    for (const nif_incoming& in : items) {
      if (in.type == NIF_MESSAGE) found.emplace_back(payload_of(in));
    }
    return found;
  }
  [[nodiscard]] std::size_t gaps() const {
    return static_cast<std::size_t>(std::count_if(
        items.begin(), items.end(), [](const auto& in) { return in.type == NIF_GAP; }));
  }

  std::vector<nif_incoming> items;
  std::size_t item_bytes = 0;  ///< as the receive queue counts them
  std::vector<proto::flow::Message> flows;
  std::vector<std::uint16_t> answers;
  std::vector<std::uint32_t> lost_groups;
  bool moved_is_news = true;
  std::uint32_t counted_group = 0;               ///< its messages count in a window
  std::uint32_t unwanted_group = 0;              ///< its messages may not wait ...
  std::size_t unwanted_bytes_max = 0;            ///< ... if they have more bytes
  std::optional<ReportedMessages::Start> start;  ///< of the message that reports are about
  std::vector<proto::Taken> taken_sent;
  std::vector<proto::Taken> taken_received;
};

/// A receiving half that is connected as kOwnId.
struct Receiving {
  explicit Receiving(const proto::ReassemblyLimits& limits = {}) : inbound(limits, host) {
    inbound.begin(session());
  }

  [[nodiscard]] static SessionTerms session() {
    SessionTerms session;
    session.id = kOwnId;
    return session;
  }

  /// Gives it the bytes, at most `step` at a time, until it has had enough.
  Inbound::Verdict feed(std::span<const std::byte> bytes, std::size_t step = SIZE_MAX) {
    auto verdict = Inbound::Verdict::going;
    while (!bytes.empty() && verdict == Inbound::Verdict::going) {
      const auto space = inbound.space();
      const std::size_t size = std::min({step, space.size(), bytes.size()});
      std::memcpy(space.data(), bytes.data(), size);
      bytes = bytes.subspan(size);
      verdict = inbound.take(size, {1, 1});
    }
    return verdict;
  }

  RecordingHost host;
  Inbound inbound;
};

inline void add_frame(std::vector<std::byte>& bytes, const proto::FrameParts& parts,
                      std::string_view payload) {
  const std::size_t at = bytes.size();
  bytes.resize(at + proto::prefix_size(parts) + payload.size());
  static_cast<void>(
      proto::write_frame(parts, std::as_bytes(std::span(payload)), std::span(bytes).subspan(at)));
}

inline void add_control(std::vector<std::byte>& bytes, proto::Kind kind,
                        const proto::Payload& payload) {
  proto::FrameParts parts;
  parts.header.kind = kind;
  parts.header.src = kHubNode;
  add_frame(bytes, parts, {reinterpret_cast<const char*>(payload.data()), payload.size()});
}

inline void add_flow(std::vector<std::byte>& bytes, const proto::flow::Message& message) {
  std::array<std::byte, proto::flow::kFrameSizeMax> frame;
  const std::size_t size = proto::flow::encode_frame(message, NodeId{kHubNode}, frame);
  bytes.insert(bytes.end(), frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(size));
}

}  // namespace gimnet::nif::test
