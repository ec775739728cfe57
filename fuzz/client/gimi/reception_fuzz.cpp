// Frames of a stranger to a program that uses GIMI: nothing breaks, nothing leaks, the connection
// goes on, and each message of another node between them is received, in order and once. Input:
// the stranger's frames.

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "client/gimi/reception.hpp"
#include "client/nif/inbound.hpp"
#include "fuzz/support/fuzz_input.hpp"
#include "fuzz/support/stranger_frames.hpp"
#include "proto/frame/frame_builder.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::gimi;

constexpr std::uint32_t kOwnId = (7u << 20) | 17;
constexpr std::uint32_t kStrangerId = kOwnId + 1;
constexpr std::uint32_t kPeerId = kOwnId + 2;
constexpr std::uint32_t kEpoch = 1;
constexpr MessageKey kKey{3, 4};
constexpr std::size_t kMessageBytesMax = 2048;
constexpr proto::ReassemblyLimits kLimits{
    .message_bytes_max = 4096, .waiting_bytes_max = 8192, .streams_max = 4};

/// GIMI's receiving side behind NIF's, without a connection: what it sends is refused.
class World final : public nif::InboundHost {
 public:
  World()
      : inbox_(64, 1 << 20, [] {}),
        streams_(uplink_, [](bool) {}),
        services_(uplink_, inbox_, [](const std::string&, const ServicePlace&) {}),
        requests_(uplink_, [] {}),
        answers_(uplink_, 1 << 20),
        accepted_(uplink_, inbox_),
        clerk_(uplink_, streams_, &requests_),
        reception_({uplink_, inbox_, streams_, services_, pings_, requests_, answers_, accepted_,
                    clerk_, losses_},
                   kMessageBytesMax),
        queue_(inbox_.queue(kKey, nullptr)),
        inbound_(kLimits, *this) {
    nif::SessionTerms session;
    session.id = kOwnId;
    inbound_.begin(session);
  }

  void feed(std::span<const std::byte> bytes) {
    const auto space = inbound_.space();
    FUZZ_MUST(space.size() >= bytes.size());
    std::memcpy(space.data(), bytes.data(), bytes.size());
    FUZZ_MUST(inbound_.take(bytes.size(), {1, 1}) == nif::Inbound::Verdict::going);
  }

  /// The next message of the peer is that one; what the stranger sent before it is thrown away.
  void expect(std::uint32_t sequence, std::string_view text) {
    for (;;) {
      const auto message = inbox_.try_receive(queue_);
      FUZZ_MUST(message.has_value());
      FUZZ_MUST(message->from().id == kPeerId || message->from().id == kStrangerId);
      if (message->from().id == kStrangerId) continue;
      FUZZ_MUST(message->sequence() == sequence && message->text() == text);
      FUZZ_MUST(!message->begins_stream() && !message->plain());
      break;
    }
    while (inbox_.try_receive(queue_)) {
    }
  }

  void deliver(std::span<const nif::Item> items) override {
    for (const nif::Item& item : items) {
      nif_incoming in = nif::incoming_of(item);
      FUZZ_MUST(in.type == NIF_MESSAGE || in.type == NIF_GAP);
      const nif_verdict verdict = in.type == NIF_MESSAGE ? reception_.on_message(in) : NIF_DONE;
      if (in.type == NIF_GAP) reception_.on_too_large(in);
      FUZZ_MUST(verdict != NIF_NOT_NOW);
      if (verdict == NIF_DONE) nif_release(&in);
    }
  }
  // Nothing of the hub's own comes.
  [[nodiscard]] bool on_flow(const proto::flow::Message&) override { return false; }
  std::vector<nif::Item> on_answer(proto::Kind, const proto::ControlView&) override { return {}; }
  [[nodiscard]] bool on_service_moved(const proto::ns::ServiceMoved&) override { return false; }
  bool on_watch_events(const proto::ns::WatchEvents&) override { return false; }
  bool is_own_service(const std::string&) override { return false; }
  void on_taken(std::uint32_t, const proto::Taken&) override {}
  bool on_report(const proto::Report&) override { return true; }
  [[nodiscard]] std::optional<nif::ReportedMessages::Start> message_of(
      const proto::Report&) override {
    return std::nullopt;
  }
  void send_taken(std::uint32_t, const proto::Taken&) override {}
  [[nodiscard]] std::uint32_t epoch_for(std::uint32_t) override { return 0; }
  [[nodiscard]] bool may_wait(std::uint32_t, std::size_t) override { return true; }
  void on_message_lost(std::uint32_t) override {}

 private:
  Uplink uplink_;
  Inbox inbox_;
  StreamTable streams_;
  ServiceTable services_;
  PingTable pings_;
  OpenRequests requests_;
  AnswerTable answers_;
  AcceptedTable accepted_;
  Clerk clerk_;
  LossTally losses_;
  Reception reception_;
  MessageQueue& queue_;
  nif::Inbound inbound_;
};

/// A DATA of the peer that asks for an ACK, in one fragment or two.
std::vector<std::vector<std::byte>> good_frames(std::uint32_t sequence, std::string_view text) {
  using proto::gimi::MessageOperation;
  std::array<std::byte, proto::gimi::kMessagePrefixMax> prefix{};
  const std::size_t size = proto::gimi::write_message_prefix(
      {sequence, MessageOperation::data, proto::gimi::kFlagAckWanted, 0, kEpoch}, std::nullopt,
      prefix);
  std::vector<std::byte> payload(prefix.begin(),
                                 prefix.begin() + static_cast<std::ptrdiff_t>(size));
  for (const char c : text) payload.push_back(static_cast<std::byte>(c));
  const std::size_t pieces = 1 + sequence % 2;
  std::vector<std::vector<std::byte>> frames;
  for (std::size_t i = 0; i < pieces; ++i) {
    const std::size_t begin = i * size;
    const std::size_t end = i + 1 == pieces ? payload.size() : size;
    proto::FrameParts parts;
    parts.header.src = kPeerId;
    parts.header.dst = kOwnId;
    parts.key = proto::gimi::StreamKey{kKey.type, kKey.instance}.value();
    if (pieces != 1)
      parts.fragment = proto::FragmentHeader{sequence, static_cast<std::uint32_t>(begin),
                                             static_cast<std::uint32_t>(payload.size())};
    parts.payload_size = end - begin;
    std::vector<std::byte> frame(proto::prefix_size(parts) + parts.payload_size);
    static_cast<void>(
        proto::write_frame(parts, std::span(payload).subspan(begin, parts.payload_size), frame));
    frames.push_back(std::move(frame));
  }
  return frames;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  World world;
  std::uint32_t sequence = 0;
  fuzz::for_each_stranger_frame(fuzz::input(data, size), kStrangerId, kOwnId,
                                [&](std::span<const std::byte> frame) {
                                  const std::string text = "good " + std::to_string(++sequence);
                                  const auto good = good_frames(sequence, text);
                                  world.feed(good.front());
                                  world.feed(frame);
                                  if (good.size() > 1) world.feed(good.back());
                                  world.expect(sequence, text);
                                });
  return 0;
}
