#include "hub/control/waiting_room.hpp"

#include <sys/epoll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>
#include <utility>

#include "base/check.hpp"
#include "base/log.hpp"
#include "hub/control/log_peer.hpp"

namespace gimnet::hub {
namespace {

using proto::Goodbye;
using proto::GoodbyeCode;
using std::chrono::milliseconds;

constexpr int kBatch = 64;
/// Closing at once would reset the connection where the peer sent more than was read, and the reset
/// could overtake GOODBYE. So the peer has limits.farewell_ms to read it and close, and may send
/// this much that nobody looks at.
constexpr std::size_t kDiscardedMax = 64 * 1'024;

LogSubject subject_of(const PeerInfo& who, const Goodbye& goodbye) {
  return {proto::goodbye_name(goodbye.code), log_peer(who.transport, who.address)};
}

std::string refusal_text(const PeerInfo& who, const Goodbye& goodbye) {
  return "refused " + who.transport + " " + who.address + ": " + goodbye.sentence + " (" +
         proto::goodbye_name(goodbye.code) + ")";
}

}  // namespace

void log_refusal(const PeerInfo& who, const Goodbye& goodbye) {
  log_line(LogLevel::info, subject_of(who, goodbye), refusal_text(who, goodbye));
}

WaitingRoom::WaitingRoom(const Limits& limits, Judge judge, RefusalCounters& refusals)
    : limits_(limits),
      judge_(std::move(judge)),
      refusals_(refusals),
      poll_(::epoll_create1(EPOLL_CLOEXEC)) {
  if (poll_ < 0) throw std::system_error(errno, std::generic_category(), "epoll_create1");
}

WaitingRoom::~WaitingRoom() { ::close(poll_); }

void WaitingRoom::enter(Stranger stranger, milliseconds now) {
  const std::string address = remote_address(stranger.peer.transport, stranger.peer.address);
  if (!address.empty()) make_place_for(address, now);
  if (waiting_.size() >= limits_.handshakes) {
    end_waiting(waiting_.front(), "too many connections wait for their HELLO; try again", now);
  }
  Peer& peer = waiting_.emplace_back();
  peer.self = std::prev(waiting_.end());
  peer.stranger = std::move(stranger);
  if (!address.empty()) join_crowd(peer, address);
  peer.handshake = std::make_unique<net::AcceptHandshake>(limits_.handshake_bytes);
  peer.deadline = now + milliseconds{limits_.handshake_ms};
  GIMNET_CHECK(peer.stranger.transport->descriptor() >= 0);
  if (!arm(peer, EPOLL_CTL_ADD)) {
    turn_away(peer, {GoodbyeCode::no_memory, "the hub is out of memory; try again later"}, now);
  }
  keep_leaving_few();
}

bool WaitingRoom::arm(Peer& peer, int operation) {
  const net::Stream& stream = *peer.stranger.transport;
  const net::Interest wanted = net::interest_of(true, false, stream.pending_out());
  if (operation == EPOLL_CTL_MOD && wanted == peer.armed) return true;
  peer.armed = wanted;
  epoll_event event{};
  event.events = wanted.write ? EPOLLIN | EPOLLOUT : EPOLLIN;
  event.data.ptr = &peer;
  return ::epoll_ctl(poll_, operation, stream.descriptor(), &event) == 0;
}

void WaitingRoom::make_place_for(std::string_view address, milliseconds now) {
  for (auto crowd = crowds_.find(address); crowd != crowds_.end(); crowd = crowds_.find(address)) {
    if (crowd->second.size() < limits_.handshakes_per_address) return;
    end_waiting(*crowd->second.front(),
                "too many connections from this address wait for their HELLO (the hub's limit "
                "handshakes_per_address is " +
                    std::to_string(limits_.handshakes_per_address) +
                    "); say it at once, and try again",
                now);
  }
}

void WaitingRoom::end_waiting(Peer& peer, const std::string& sentence, milliseconds now) {
  const std::size_t waiting = waiting_.size();
  read(peer, now);
  if (waiting_.size() == waiting) turn_away(peer, {GoodbyeCode::hello_timeout, sentence}, now);
}

void WaitingRoom::join_crowd(Peer& peer, std::string_view address) {
  const auto crowd = crowds_.try_emplace(std::string{address}).first;
  crowd->second.push_back(&peer);
  peer.crowd = crowd;
  peer.in_crowd = std::prev(crowd->second.end());
}

void WaitingRoom::leave_crowd(Peer& peer) {
  if (!peer.crowd) return;
  const Crowds::iterator crowd = *std::exchange(peer.crowd, std::nullopt);
  crowd->second.erase(peer.in_crowd);
  if (crowd->second.empty()) crowds_.erase(crowd);
}

bool WaitingRoom::serve(milliseconds now) {
  std::array<epoll_event, kBatch> events{};
  const int count = ::epoll_wait(poll_, events.data(), kBatch, 0);
  for (int i = 0; i < count; ++i) {
    // Each event removes its own peer only, so none of the batch is stale.
    const epoll_event& event = events[static_cast<std::size_t>(i)];
    Peer& peer = *static_cast<Peer*>(event.data.ptr);
    if ((event.events & EPOLLOUT) != 0) {
      // A stream that failed tells so when it is read.
      static_cast<void>(peer.stranger.transport->send({}));
      static_cast<void>(arm(peer, EPOLL_CTL_MOD));
      if ((event.events & ~std::uint32_t{EPOLLOUT}) == 0) continue;
    }
    if (peer.handshake != nullptr) {
      read(peer, now);
    } else {
      discard(peer);
    }
  }
  keep_leaving_few();
  return count == kBatch;
}

void WaitingRoom::stood_still(milliseconds time, milliseconds now) {
  const auto put_off = [time](Peers& peers, milliseconds latest) {
    for (Peer& peer : peers)
      peer.deadline = std::min(peer.deadline + time, latest);  // nothing began later than now
  };
  put_off(waiting_, now + milliseconds{limits_.handshake_ms});
  put_off(leaving_, now + milliseconds{limits_.farewell_ms});
}

void WaitingRoom::tick(milliseconds now) {
  while (!waiting_.empty() && waiting_.front().deadline <= now) {
    end_waiting(waiting_.front(), "no HELLO within " + std::to_string(limits_.handshake_ms) + " ms",
                now);
  }
  while (!leaving_.empty() && leaving_.front().deadline <= now) remove(leaving_.front());
  keep_leaving_few();
}

void WaitingRoom::dismiss_all(const Goodbye& goodbye, milliseconds now) {
  closing_ = true;
  while (!waiting_.empty()) turn_away(waiting_.front(), goodbye, now);
}

std::optional<milliseconds> WaitingRoom::next_deadline() const {
  std::optional<milliseconds> deadline;
  if (!waiting_.empty()) deadline = waiting_.front().deadline;
  if (!leaving_.empty() && (!deadline || leaving_.front().deadline < *deadline))
    deadline = leaving_.front().deadline;
  return deadline;
}

void WaitingRoom::read(Peer& peer, milliseconds now) {
  const net::IoResult result = peer.stranger.transport->receive(peer.handshake->room());
  if (result.status == net::IoStatus::would_block)
    return static_cast<void>(arm(peer, EPOLL_CTL_MOD));
  if (result.status != net::IoStatus::ok) {
    if (peer.handshake->begun()) refusals_.unfinished.add(1);
    return remove(peer);
  }
  switch (peer.handshake->took(result.bytes)) {
    case net::AcceptHandshake::Verdict::more:
      if (peer.stranger.transport->pending_in() != 0) return read(peer, now);
      return static_cast<void>(arm(peer, EPOLL_CTL_MOD));
    case net::AcceptHandshake::Verdict::hello:
      return judge(peer, now);
    case net::AcceptHandshake::Verdict::refused: {
      const Goodbye goodbye = peer.handshake->refusal();
      return turn_away(peer, goodbye, now);
    }
    case net::AcceptHandshake::Verdict::garbage:
      refusals_.garbage.add(1);
      log_line(LogLevel::debug,
               {"garbage", log_peer(peer.stranger.peer.transport, peer.stranger.peer.address)},
               "closed " + peer.stranger.peer.address + ": what it sent is not this protocol");
      return remove(peer);
  }
}

void WaitingRoom::judge(Peer& peer, milliseconds now) {
  // The shard will wait for the descriptor from here on.
  ::epoll_ctl(poll_, EPOLL_CTL_DEL, peer.stranger.transport->descriptor(), nullptr);
  const std::optional<Goodbye> refusal = this->refusal(peer);
  if (!refusal) {
    leave_crowd(peer);
    waiting_.erase(peer.self);
    return;
  }
  static_cast<void>(arm(peer, EPOLL_CTL_ADD));
  turn_away(peer, *refusal, now);
}

std::optional<Goodbye> WaitingRoom::refusal(Peer& peer) const {
  const proto::Hello& hello = peer.handshake->hello();
  if (peer.stranger.on_reserve && hello.role != proto::Role::admin) {
    return Goodbye{GoodbyeCode::no_memory,
                   "the hub is out of descriptors, and keeps its last ones for administrators; try "
                   "again later"};
  }
  return judge_(peer.stranger, hello);
}

Acceptor::Room WaitingRoom::give_way_to(const Stranger& newcomer) {
  const bool for_administrator = newcomer.rights.administer;
  auto gone = std::ranges::find_if(
      leaving_, [&](const Peer& peer) { return for_administrator || !peer.stranger.on_reserve; });
  const bool told = gone != leaving_.end();
  if (!told) {
    gone = std::ranges::find_if(waiting_,
                                [](const Peer& peer) { return !peer.stranger.rights.administer; });
    if (gone == waiting_.end() && for_administrator) gone = waiting_.begin();
    if (gone == waiting_.end()) return Acceptor::Room::none;
    const Goodbye goodbye{
        GoodbyeCode::no_memory,
        "the hub is out of descriptors, and others wait; say HELLO at once, or try again later"};
    refusals_.no_descriptor.add(1);
    log_refusal(gone->stranger.peer, goodbye);
    static_cast<void>(send_goodbye(*gone->stranger.transport, goodbye.code, goodbye.sentence));
  }
  const bool reserved = gone->stranger.on_reserve;
  remove(*gone);
  return reserved ? Acceptor::Room::reserved : Acceptor::Room::ordinary;
}

void WaitingRoom::discard(Peer& peer) {
  std::array<std::byte, 4'096> nobody_looks{};
  net::Stream& stream = *peer.stranger.transport;
  do {
    const net::IoResult result = stream.receive(nobody_looks);
    if (result.status == net::IoStatus::would_block) break;
    peer.discarded += result.bytes;
    if (result.status != net::IoStatus::ok || peer.discarded > kDiscardedMax) return remove(peer);
  } while (stream.pending_in() != 0);
  static_cast<void>(arm(peer, EPOLL_CTL_MOD));
}

void WaitingRoom::turn_away(Peer& peer, const Goodbye& goodbye, milliseconds now) {
  // A hub dials again, after half a second at most, as long as nobody changes its configuration.
  const PeerInfo& who = peer.stranger.peer;
  if (peer.handshake->hello().role == proto::Role::hub) {
    log_seldom(LogLevel::info, subject_of(who, goodbye), refusal_text(who, goodbye), now);
  } else {
    log_refusal(who, goodbye);
  }
  if (peer.stranger.on_reserve && goodbye.code == GoodbyeCode::no_memory) {
    refusals_.no_descriptor.add(1);
  } else {
    refusals_.count(goodbye.code);
  }
  if (!send_goodbye(*peer.stranger.transport, goodbye.code, goodbye.sentence)) return remove(peer);
  leave_crowd(peer);
  peer.handshake.reset();
  leaving_.splice(leaving_.end(), waiting_, peer.self);
  begin_leaving(peer, now);
  static_cast<void>(arm(peer, EPOLL_CTL_MOD));
}

void WaitingRoom::keep_leaving_few() {
  // At the end there are no more than there were nodes, and nobody waits for their places.
  if (closing_) return;
  while (leaving_.size() > limits_.handshakes) remove(leaving_.front());
}

void WaitingRoom::see_off(std::unique_ptr<net::Stream> transport, milliseconds now) {
  Peer& peer = leaving_.emplace_back();
  peer.self = std::prev(leaving_.end());
  peer.stranger.transport = std::move(transport);
  begin_leaving(peer, now);
  // Without a place in the poll set it is closed at its deadline all the same.
  static_cast<void>(arm(peer, EPOLL_CTL_ADD));
  keep_leaving_few();
}

void WaitingRoom::begin_leaving(Peer& peer, milliseconds now) {
  peer.stranger.transport->shut_down();
  peer.deadline = now + milliseconds{limits_.farewell_ms};
}

void WaitingRoom::remove(Peer& peer) {
  Peers& list = peer.handshake != nullptr ? waiting_ : leaving_;
  leave_crowd(peer);
  list.erase(peer.self);  // closing the descriptor takes it out of the poll set
}

}  // namespace gimnet::hub
