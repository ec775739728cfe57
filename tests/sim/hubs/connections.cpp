#include <algorithm>

#include "base/endian.hpp"
#include "tests/sim/hubs/world.hpp"

// Hubs dial each other, and their bytes come across.

namespace gimnet::sim::hubs {
namespace {

constexpr std::string_view kName = "wire";
/// The kernel sends the first packet of a connection again after 1 s and 3 s; the dialler gives up
/// after 5 s.
constexpr std::array<std::uint64_t, 3> kTriesAfter = {1'000, 2'000, 2'000};
constexpr std::uint64_t kAttemptMs = 5'000;
/// Longer than any pause before a link is dialled again, but that of a hub that may be a copy.
constexpr milliseconds kDialledWithin{1'100};

}  // namespace

hub::DialledLink World::link_of(std::size_t wire) {
  hub::DialledLink link;
  link.address.host = "127.0.0.1";
  link.address.port = static_cast<std::uint16_t>(1'000 + wire);
  link.name = std::string{kName} + std::to_string(wire);
  return link;
}

void World::dial(std::size_t machine, hub::LinkNumber number, const hub::DialledLink& to,
                 const proto::Hello& hello) {
  const auto wire = static_cast<std::size_t>(std::stoul(to.name.substr(kName.size())));
  auto line = std::make_shared<Line>(wire, wires_[wire].plan);
  line->number = ++lines_begun_;
  line->link = number;
  line->hello = hello;
  line->dialler_life = machines_[machine].life;
  lines_.push_back(line);
  note("wire " + std::to_string(wire) + " is dialled on line " + std::to_string(line->number));
  after_ms(kAttemptMs, [this, line] {
    if (line->stream != nullptr) fail(*line, {net::Fault::timeout, "nobody answers"});
  });
  attempt(line, 0);
}

void World::attempt(const std::shared_ptr<Line>& line, std::size_t tries) {
  const Wire& wire = wires_[line->wire];
  const bool blocked = wire.cut[0] || wire.cut[1] || machines_[wire.plan.acceptor].dark;
  if (!blocked) {
    return after_ms(2 * wire.plan.delay_ms, [this, line] { reach_acceptor(line); });
  }
  if (tries < kTriesAfter.size())
    after_ms(kTriesAfter[tries], [this, line, tries] { attempt(line, tries + 1); });
}

void World::reach_acceptor(const std::shared_ptr<Line>& line) {
  if (line->failed) return;
  Machine& machine = machines_[wires_[line->wire].plan.acceptor];
  if (machine.hub == nullptr) return fail(*line, {net::Fault::no_peer, "nobody listens"});
  // A process that gets no time takes nobody from its listener, yet.
  if (machine.stopped) return after_ms(10, [this, line] { reach_acceptor(line); });
  hub::Stranger stranger;
  stranger.transport = std::move(line->other);
  stranger.peer = {"tcp", "127.0.0.1:" + std::to_string(line->number)};
  stranger.identity = hub::Identity::open();
  line->accepted = true;
  const auto refused = machine.hub->admit(std::move(stranger), line->peers[1], line->hello, now_);
  if (!refused) return note_counts(*line, 1);
  net::NetError error{net::Fault::refused, refused->sentence};
  error.goodbye = refused->code;
  after_ms(wires_[line->wire].plan.delay_ms, [this, line, error] { fail(*line, error); });
}

void World::fail(Line& line, net::NetError error) {
  if (line.failed || line.stream == nullptr) return;
  line.failed = true;
  line.stream.reset();
  line.other.reset();
  Machine& machine = machines_[wires_[line.wire].plan.dialler];
  if (machine.hub == nullptr || machine.life != line.dialler_life) return;
  machine.hub->on_not_dialled(line.link, std::move(error), now_);
  note_dialled(line);
}

/// A hub that was taken for a copy waits.
void World::note_dialled(const Line& line) {
  note_counts(line, 0);
  const hub::HubLink* const link = find_link(line.wire, 0);
  if (link == nullptr || !link->dial_at()) return;
  note("wire " + std::to_string(line.wire) + " waits for " +
       std::to_string((*link->dial_at() - now_).count()) + " ms: " + link->last_error);
  if (*link->dial_at() > now_ + kDialledWithin) copied_at_ = now_;
}

void World::carry(Line& line) {
  Wire& wire = wires_[line.wire];
  for (std::size_t way = 0; way < 2; ++way) {
    if (line.dead || wire.cut[way]) continue;
    const Crossing crossing{line.wire, way == 0 ? wire.plan.dialler : wire.plan.acceptor,
                            way == 0 ? wire.plan.acceptor : wire.plan.dialler};
    Flow& flow = line.flows[way];
    flow.take(random_, now_,
              [&](const proto::FrameHeader& header, std::span<const std::byte> body) {
                // Bytes that a closed connection left in the kernel reach nobody.
                if (line.peers[1 - way].transport_gone()) return;
                ++wire.frames;
                if (options_.print && header.kind == proto::Kind::unicast && body.size() >= 8)
                  note("frame " + std::to_string(load_le<std::uint64_t>(body.data())) +
                       " on line " + std::to_string(line.number) + " from hub " +
                       std::to_string(crossing.from) + " to " + std::to_string(crossing.to));
                book_.note_crossing(crossing, header, body);
              });
    hub::MemoryPeer& to = line.peers[1 - way];
    while (const auto bytes = flow.arrive(now_)) {
      if (way == 1 && line.stream != nullptr) {
        come_to_dialler(line, *bytes);
      } else if (bytes->empty()) {
        to.close();
      } else {
        to.write(*bytes);
      }
    }
  }
}

/// The dialler reads no further than WELCOME.
void World::come_to_dialler(Line& line, std::span<const std::byte> bytes) {
  if (bytes.empty()) return fail(line, {net::Fault::no_peer, "the connection broke"});
  auto state = net::DialHandshake::State::need_more;
  while (!bytes.empty() && state == net::DialHandshake::State::need_more) {
    const std::size_t size = std::min(bytes.size(), line.handshake.missing());
    state = line.handshake.take(bytes.first(size));
    bytes = bytes.subspan(size);
  }
  if (state == net::DialHandshake::State::need_more) return;
  if (state != net::DialHandshake::State::welcome)
    return fail(line, {net::Fault::refused, line.handshake.goodbye().sentence});
  if (!bytes.empty()) line.peers[0].write(bytes);
  Machine& machine = machines_[wires_[line.wire].plan.dialler];
  std::unique_ptr<net::Stream> stream = std::move(line.stream);
  if (machine.hub == nullptr || machine.life != line.dialler_life) return;
  const proto::Welcome& welcome = line.handshake.welcome();
  if (welcome.resumed) census_.note(Event::resumed);
  note("wire " + std::to_string(line.wire) + " is up on line " + std::to_string(line.number) +
       (welcome.resumed ? ", resumed, taken " + std::to_string(welcome.taken) + " and " +
                              std::to_string(line.hello.resume_taken)
                        : ""));
  machine.hub->on_dialled(line.link, std::move(stream), line.peers[0], line.handshake.welcome(),
                          now_);
  note_dialled(line);
}

bool World::is_over(const Line& line) const {
  if (line.failed && !line.accepted) return true;
  const bool gone = line.peers[0].transport_gone() && line.peers[1].transport_gone();
  return gone && (line.dead || (line.flows[0].ended() && line.flows[1].ended()));
}

/// Notes on which line the counts of that end of its link began.
void World::note_counts(const Line& line, std::size_t end) {
  Wire& wire = wires_[line.wire];
  const Machine& machine = machines_[end == 0 ? wire.plan.dialler : wire.plan.acceptor];
  const hub::HubLink* const link = find_link(line.wire, end);
  if (machine.hub == nullptr || link == nullptr || !link->place) return;
  Wire::Counted& counted = wire.counted[end];
  if (counted.life != machine.life || counted.generation != link->place->generation)
    counted = {machine.life, link->place->generation, line.number};
}

const hub::HubLink* World::find_link(std::size_t wire, std::size_t end) const {
  const WirePlan& plan = wires_[wire].plan;
  const Machine& machine = machines_[end == 0 ? plan.dialler : plan.acceptor];
  const std::string name = link_of(wire).name;
  if (machine.hub == nullptr) return nullptr;
  for (const auto& [number, link] : machine.hub->links().all())
    if (!link->is_over() && link->name() == name && link->is_dialled() == (end == 0))
      return link.get();
  return nullptr;
}

}  // namespace gimnet::sim::hubs
