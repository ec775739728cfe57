#include "client/nif/dialer.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "client/nif/handshake.hpp"

namespace gimnet::nif {
namespace {

Failure closed_early(const Endpoint& endpoint) {
  return {NIF_NO_HUB, "the peer at " + endpoint.url() +
                          " closed the connection before it said WELCOME; is it a hub?"};
}

/// Nothing: all is written.
std::optional<Failure> write_all(Socket& socket, std::span<const std::byte> bytes,
                                 const Endpoint& endpoint, Deadline deadline,
                                 const WakeSignal& cancel) {
  while (!bytes.empty()) {
    const IoResult result = socket.write(std::span(&bytes, 1));
    bytes = bytes.subspan(result.bytes);
    if (result.state == IoResult::State::failed) return closed_early(endpoint);
    if (result.state != IoResult::State::would_block) continue;
    const Ready ready = wait_for(socket, false, true, cancel, deadline);
    if (ready.woken) return Failure{NIF_CLOSED, "closed while connecting to " + endpoint.url()};
    if (!ready.writable && steady_now_ns() >= deadline) {
      return Failure{NIF_TIMEOUT, "the peer at " + endpoint.url() + " takes no bytes"};
    }
  }
  return std::nullopt;
}

Failure refused(const proto::Goodbye& goodbye, const Endpoint& endpoint) {
  const std::string reason =
      goodbye.sentence.empty() ? std::string(proto::goodbye_name(goodbye.code)) : goodbye.sentence;
  return {status_of(goodbye.code), "the hub at " + endpoint.url() + " refused: " + reason};
}

/// Reads until the handshake is over, one way or the other.
std::optional<Failure> await_answer(Socket& socket, Handshake& handshake, const Endpoint& endpoint,
                                    Deadline deadline, const WakeSignal& cancel) {
  std::array<std::byte, 4096> memory;
  for (;;) {
    const IoResult result = socket.read(memory);
    if (result.state == IoResult::State::ended || result.state == IoResult::State::failed) {
      return closed_early(endpoint);
    }
    if (result.state == IoResult::State::would_block) {
      const Ready ready = wait_for(socket, true, false, cancel, deadline);
      if (ready.woken) return Failure{NIF_CLOSED, "closed while connecting to " + endpoint.url()};
      if (!ready.readable && steady_now_ns() >= deadline) {
        return Failure{NIF_TIMEOUT,
                       "the peer at " + endpoint.url() + " does not answer HELLO; is it a hub?"};
      }
      continue;
    }
    switch (handshake.take(std::span(memory).first(result.bytes))) {
      case Handshake::State::need_more:
        break;
      case Handshake::State::welcome:
        return std::nullopt;
      case Handshake::State::goodbye:
        return refused(handshake.goodbye(), endpoint);
      case Handshake::State::failed:
        return Failure{handshake.failure().status,
                       endpoint.url() + ": " + handshake.failure().sentence};
    }
  }
}

Result<Admitted, Failure> admit_at(const Endpoint& endpoint, const SocketOptions& options,
                                   proto::Hello hello, Deadline deadline, const WakeSignal& cancel,
                                   const TokenFor& token_for) {
  auto dialed = dial(endpoint, options, deadline, cancel);
  if (!dialed) return dialed.error();
  if (hello.token.empty() && token_for) hello.token = token_for(endpoint.url());
  const std::vector<std::byte> opening = encode_hello(hello);
  // A hub that refuses may close before it has read everything: what it said is still there to
  // read.
  const auto unwritten = write_all(*dialed, opening, endpoint, deadline, cancel);
  if (unwritten && unwritten->status != NIF_NO_HUB) return *unwritten;
  Handshake handshake(hello.resume, hello.resume_epoch);
  if (auto failure = await_answer(*dialed, handshake, endpoint, deadline, cancel))
    return std::move(*failure);
  const auto rest = handshake.rest();
  return Admitted{
      std::move(*dialed), endpoint.url(), handshake.session(), {rest.begin(), rest.end()}};
}

}  // namespace

Result<Admitted, Failure> admit(std::span<const Endpoint> endpoints, const SocketOptions& options,
                                const proto::Hello& hello, Deadline deadline,
                                const WakeSignal& cancel, const TokenFor& token_for) {
  Failure last{NIF_NO_HUB, "no address to connect to"};
  for (const Endpoint& endpoint : endpoints) {
    auto admitted = admit_at(endpoint, options, hello, deadline, cancel, token_for);
    if (admitted || admitted.error().status != NIF_NO_HUB) return admitted;
    last = admitted.error();
  }
  return last;
}

std::int64_t Backoff::next_ns(std::uint64_t random) {
  const auto wait = static_cast<std::int64_t>(random % static_cast<std::uint64_t>(limit_ns_));
  limit_ns_ = std::min(limit_ns_ * 2, kLastNs);
  return wait;
}

}  // namespace gimnet::nif
