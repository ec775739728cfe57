// The receiving side of NIF against a hub that sends anything: the same bytes give the same
// messages however they are split, nothing that is another node's or larger than allowed comes out,
// and nothing breaks. Frames of another node do not even end the connection, and messages of a
// third one come whole between them. Input: a byte that chooses handshake or connection and the
// size of the pieces, then the hub's bytes.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "client/nif/hub_clock.hpp"
#include "client/nif/inbound.hpp"
#include "client/nif/outbound.hpp"
#include "client/nif/request_table.hpp"
#include "fuzz/support/fuzz_input.hpp"
#include "fuzz/support/stranger_frames.hpp"
#include "net/dial_handshake.hpp"
#include "net/proxy_handshake.hpp"
#include "proto/frame/frame_builder.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::nif;

constexpr std::uint32_t kOwnId = (7u << 20) | 17;
constexpr std::uint32_t kStrangerId = kOwnId + 1;
constexpr std::uint32_t kPeerId = kOwnId + 2;
constexpr proto::ReassemblyLimits kLimits{
    .message_bytes_max = 4096, .waiting_bytes_max = 8192, .streams_max = 4};

/// Everything that the receiving half asks for, written down; what a node would do with it is done,
/// too.
class Witness final : public InboundHost {
 public:
  Witness() : outbound_({}, wake_), requests_(outbound_) {}

  [[nodiscard]] bool on_flow(const proto::flow::Message& message) override {
    note("flow " + std::to_string(message.index()));
    if (const auto* pong = std::get_if<proto::flow::Pong>(&message)) {
      const auto ping = clock_.ping(1, 2);
      clock_.on_pong({ping.sequence, pong->sent_ns, pong->now_ns}, 3);
    }
    if (const auto* pause = std::get_if<proto::flow::Pause>(&message))
      outbound_.on_pause(pause->target);
    if (const auto* resume = std::get_if<proto::flow::Resume>(&message))
      outbound_.on_resume(resume->target);
    const auto* confirm = std::get_if<proto::flow::Confirm>(&message);
    return confirm == nullptr || outbound_.on_confirm(confirm->count);
  }
  std::vector<Item> on_answer(proto::Kind kind, const proto::ControlView& answer) override {
    note("answer " + std::to_string(answer.header.request));
    FUZZ_MUST(!requests_.on_answer(kind, answer));
    return {};
  }
  [[nodiscard]] bool on_service_moved(const proto::ns::ServiceMoved& event) override {
    note("moved " + event.name);
    return event.provider != NodeId{};
  }
  bool is_own_service(const std::string& name) override { return name.starts_with("own/"); }
  bool on_watch_events(const proto::ns::WatchEvents& events) override {
    note("watched " + std::to_string(events.watch));
    return true;
  }
  void on_taken(std::uint32_t from, const proto::Taken& taken) override {
    note("taken " + std::to_string(taken.message));
    static_cast<void>(outbound_.on_taken(from, taken));
  }
  bool on_report(const proto::Report& report) override { return outbound_.on_report(report); }
  [[nodiscard]] std::optional<ReportedMessages::Start> message_of(
      const proto::Report& report) override {
    return outbound_.message_of(report);
  }
  void send_taken(std::uint32_t to, const proto::Taken& taken) override {
    note("tell " + std::to_string(to) + " " + std::to_string(taken.message) + " " +
         std::to_string(taken.taken) + " " + std::to_string(taken.allowed));
  }
  [[nodiscard]] std::uint32_t epoch_for(std::uint32_t group) override { return group & 1; }
  [[nodiscard]] bool may_wait(std::uint32_t, std::size_t) override { return true; }
  void on_message_lost(std::uint32_t) override {}
  void deliver(std::span<const Item> items) override {
    for (const Item& item : items) {
      nif_incoming in = incoming_of(item);
      witness(in);
      nif_release(&in);
    }
  }

  [[nodiscard]] const std::vector<std::string>& delivered() const { return delivered_; }
  [[nodiscard]] const std::vector<std::string>& asked() const { return asked_; }
  [[nodiscard]] std::uint32_t messages_of_peer() const { return messages_of_peer_; }

 private:
  void note(std::string what) { asked_.push_back(std::move(what)); }

  void witness(const nif_incoming& in) {
    FUZZ_MUST(in.text != nullptr && in.storage != nullptr);
    FUZZ_MUST(in.type != NIF_MESSAGE || in.kind != NIF_UNICAST || in.to == kOwnId);
    FUZZ_MUST(in.type != NIF_MESSAGE || in.size <= proto::kFrameLengthDefault);
    messages_of_peer_ += in.type == NIF_MESSAGE && in.from == kPeerId && in.size == 6 ? 1 : 0;
    std::string written = std::to_string(in.type) + "/" + std::to_string(in.from) + "/" +
                          std::to_string(in.to) + "/" + std::to_string(in.kind) + "/" +
                          std::to_string(in.flags) + "/" + std::to_string(in.key) + "/" +
                          std::to_string(in.count) + "/" + std::to_string(in.reason) + "/" +
                          in.text + "/";
    if (in.size > 0) written.append(static_cast<const char*>(in.payload), in.size);
    if (in.extensions_size > 0)
      written.append(static_cast<const char*>(in.extensions), in.extensions_size);
    delivered_.push_back(std::move(written));
  }

  net::WakeSignal wake_;
  Outbound outbound_;
  RequestTable requests_;
  HubClock clock_;
  std::vector<std::string> delivered_;
  std::vector<std::string> asked_;
  std::uint32_t messages_of_peer_ = 0;
};

Inbound::Verdict feed(Inbound& inbound, std::span<const std::byte> bytes, std::size_t step) {
  auto verdict = Inbound::Verdict::going;
  while (verdict == Inbound::Verdict::going && !bytes.empty()) {
    const auto space = inbound.space();
    FUZZ_MUST(space.size() >= proto::kFrameLengthDefault / 2);
    const std::size_t size = std::min({step, space.size(), bytes.size()});
    std::memcpy(space.data(), bytes.data(), size);
    bytes = bytes.subspan(size);
    verdict = inbound.take(size, {1, 1});
  }
  return verdict;
}

void check_connection(std::span<const std::byte> bytes, std::size_t step) {
  SessionTerms session;
  session.id = kOwnId;
  session.resume = true;
  session.hub_resume_bytes = 1024;
  Witness whole_witness;
  Witness split_witness;
  Inbound whole(kLimits, whole_witness);
  Inbound split(kLimits, split_witness);
  whole.begin(session);
  split.begin(session);
  const auto verdict = feed(whole, bytes, SIZE_MAX);
  FUZZ_MUST(feed(split, bytes, step) == verdict);
  FUZZ_MUST(whole.taken() == split.taken());
  FUZZ_MUST(whole_witness.delivered() == split_witness.delivered());
  FUZZ_MUST(whole_witness.asked() == split_witness.asked());
  FUZZ_MUST(verdict != Inbound::Verdict::malformed || !whole.fault().empty());
  // The next connection begins clean, with or without resume.
  session.resumed = (step & 1) != 0;
  whole.begin(session);
  FUZZ_MUST(session.resumed || whole.taken() == 0);
  static_cast<void>(feed(whole, bytes, step));
}

/// A message in two fragments, of a node that keeps to the protocol.
std::array<std::vector<std::byte>, 2> good_fragments(std::uint32_t number) {
  const std::array<std::byte, 3> piece{std::byte{'o'}, std::byte{'k'}, std::byte{'!'}};
  std::array<std::vector<std::byte>, 2> frames;
  for (std::uint32_t i = 0; i < 2; ++i) {
    proto::FrameParts parts;
    parts.header.src = kPeerId;
    parts.header.dst = kOwnId;
    parts.fragment = proto::FragmentHeader{number, 3 * i, 6};
    parts.payload_size = piece.size();
    frames[i].resize(proto::prefix_size(parts) + piece.size());
    static_cast<void>(proto::write_frame(parts, piece, frames[i]));
  }
  return frames;
}

/// Frames of another node never end a connection, whatever is in them, and cost no third node a
/// message.
void check_strangers(std::span<const std::byte> bytes, std::size_t step) {
  SessionTerms session;
  session.id = kOwnId;
  Witness witness;
  Inbound inbound(kLimits, witness);
  inbound.begin(session);
  const auto must_go_on = [&](std::span<const std::byte> frame) {
    FUZZ_MUST(feed(inbound, frame, step) == Inbound::Verdict::going);
  };
  std::uint32_t sent = 0;
  fuzz::for_each_stranger_frame(bytes, kStrangerId, kOwnId, [&](std::span<const std::byte> frame) {
    const auto good = good_fragments(++sent);
    must_go_on(good[0]);
    must_go_on(frame);
    must_go_on(good[1]);
    FUZZ_MUST(witness.messages_of_peer() == sent);
  });
}

net::DialHandshake::State shake(net::DialHandshake& handshake, std::span<const std::byte> bytes,
                                std::size_t step) {
  auto state = net::DialHandshake::State::need_more;
  while (state == net::DialHandshake::State::need_more && !bytes.empty()) {
    const std::size_t size = std::min(step, bytes.size());
    const fuzz::ExactCopy piece(bytes.first(size));
    state = handshake.take(piece.span());
    bytes = bytes.subspan(size);
  }
  return state;
}

void check_handshake(std::span<const std::byte> bytes, std::size_t step) {
  net::DialHandshake whole;
  net::DialHandshake split;
  const auto state = shake(whole, bytes, SIZE_MAX);
  FUZZ_MUST(shake(split, bytes, step) == state);
  FUZZ_MUST(state != net::DialHandshake::State::failed || !whole.error().sentence.empty());
  if (state != net::DialHandshake::State::welcome) return;
  FUZZ_MUST(whole.welcome() == split.welcome());
  const auto checked = session_terms_of(whole.welcome(), true, 0x1234);
  FUZZ_MUST(checked || !checked.error().sentence.empty());
  if (!checked) return;
  const SessionTerms& session = *checked;
  FUZZ_MUST(hub_of(NodeId{session.id}).value() == session.hub_id && !session.token.empty());
  FUZZ_MUST(session.keep_alive_ns > 0 && session.silent_after_ns >= 2 * session.keep_alive_ns);
  FUZZ_MUST(session.frame_bytes_max <= proto::kFrameLengthDefault);
  FUZZ_MUST(!session.resumed || session.hub_epoch == 0x1234);
}

/// The same bytes as a proxy's answer to CONNECT.
void check_proxy(std::span<const std::byte> bytes) {
  using State = net::ProxyHandshake::State;
  net::Address hub;
  hub.host = "hub";
  hub.port = 1;
  net::ProxyHandshake handshake({"p", 1, "ann", "secret"}, hub);
  std::size_t taken = 0;
  while (handshake.state() == State::need_more && taken < bytes.size())
    handshake.take(bytes[taken++]);
  FUZZ_MUST(taken <= net::ProxyHandshake::kAnswerBytesMax + 1);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), taken);
  if (handshake.state() == State::open)
    FUZZ_MUST(text.starts_with("HTTP/1.") && text[9] == '2' && text.ends_with('\n'));
  if (handshake.state() != State::failed) return;
  const std::string& words = handshake.error().sentence;
  FUZZ_MUST(!words.empty() && words.size() < 400);
  // The sentence repeats words of the proxy, but never the password that the node sent to it.
  const bool proxy_said_it = text.find("secret") != std::string_view::npos;
  FUZZ_MUST(proxy_said_it || words.find("secret") == std::string::npos);
  FUZZ_MUST(std::ranges::all_of(words, [](char letter) { return letter >= ' ' && letter <= '~'; }));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto bytes = fuzz::input(data + 1, size - 1);
  const std::size_t step = 1u + (data[0] >> 1);
  if ((data[0] & 1) != 0) {
    check_handshake(bytes, step);
    check_proxy(bytes);
  } else {
    check_connection(bytes, step);
    check_strangers(bytes, step);
  }
  return 0;
}
