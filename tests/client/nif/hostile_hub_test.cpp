#include <gtest/gtest.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include "base/endian.hpp"
#include "net/dial_handshake.hpp"
#include "proto/control/ns_watch.hpp"
#include "tests/client/nif/support/fake_hub.hpp"
#include "tests/client/nif/support/recording_host.hpp"

// A hub that sends what no hub may: the node takes nothing partial, keeps nothing, and lives. Whole
// classes of bytes in memory, samples of each over a socket.

namespace gimnet::nif::test {
namespace {

using Bytes = std::vector<std::byte>;

constexpr std::uint8_t kEvents[] = {32, 33, 34, 35, 36, 37};

proto::FrameParts message_parts(proto::Kind kind = proto::Kind::unicast) {
  proto::FrameParts parts;
  parts.header.kind = kind;
  parts.header.src = kPeerId;
  parts.header.dst = kOwnId;
  return parts;
}

Bytes keyed_message() {
  Bytes bytes;
  proto::FrameParts parts = message_parts();
  parts.key = 5;
  add_frame(bytes, parts, "payload");
  return bytes;
}

Bytes header_bytes(const proto::FrameHeader& header, std::size_t payload = 0) {
  Bytes bytes(proto::kHeaderSize + payload);
  proto::store_header(bytes.data(), header);
  return bytes;
}

/// One value of a Bitestream, whatever it says of itself.
void add_value(Bytes& stream, unsigned type, unsigned size_code, std::uint32_t key,
               std::uint32_t length, std::size_t bytes) {
  stream.push_back(static_cast<std::byte>(type << 3 | size_code));
  for (unsigned shift = 0; shift < 24; shift += 8)
    stream.push_back(static_cast<std::byte>(key >> shift));
  const unsigned size_bytes = 1u << std::min(size_code, 2u);
  for (unsigned i = 0; i < size_bytes; ++i)
    stream.push_back(static_cast<std::byte>(length >> (8 * i)));
  stream.resize(stream.size() + bytes, std::byte{1});
}

/// Bodies of control messages that lie about their sizes, types and depth.
std::vector<Bytes> hostile_bodies() {
  std::vector<Bytes> bodies;
  for (const std::uint32_t length :
       {0x2000'0000u, 0x4000'0000u, 0x7FFF'FFFFu, 0xFFFF'FFFFu, 9u, 0u}) {
    for (const unsigned type : {0u, 12u, 14u, 20u, 21u, 29u}) {  // "2^29 elements", with 8 bytes
      for (const std::uint32_t key : {1u, 2u, 3u, 4u})
        add_value(bodies.emplace_back(), type, 2, key, length, 8);
    }
  }
  Bytes deep;
  for (std::uint32_t left = 60'000; left > 16; left -= 8) add_value(deep, 14, 2, 3, left - 8, 0);
  bodies.push_back(deep);
  Bytes repeated;
  while (repeated.size() < 60'000) add_value(repeated, 4, 0, 3, 4, 4);
  bodies.push_back(repeated);
  for (unsigned type = 0; type < 32; ++type) {  // each key as something that it is not
    for (const std::size_t size : {std::size_t{1}, std::size_t{3}, std::size_t{8}}) {
      Bytes& confused = bodies.emplace_back();
      for (std::uint32_t key = 1; key <= 16; ++key) {
        add_value(confused, type, 0, key, static_cast<std::uint32_t>(size), size);
      }
    }
  }
  bodies.push_back(Bytes(100, std::byte{0xFF}));
  bodies.push_back(Bytes(100, std::byte{0}));
  bodies.push_back({});
  return bodies;
}

proto::Payload control(std::uint16_t operation, std::uint16_t request, const Bytes& body) {
  proto::Payload payload(proto::kControlHeaderSize + body.size());
  store_le(payload.data(), operation);
  store_le(payload.data() + 2, request);
  std::ranges::copy(body, payload.begin() + proto::kControlHeaderSize);
  return payload;
}

TEST(HostileHub, AMessageThatIsCutAnywhereIsNotDelivered) {
  const Bytes whole = keyed_message();
  for (std::size_t cut = 0; cut < whole.size(); ++cut) {
    Receiving receiving;
    EXPECT_EQ(receiving.feed(std::span(whole).first(cut)), Inbound::Verdict::going) << cut;
    EXPECT_TRUE(receiving.host.items.empty()) << cut;
    EXPECT_EQ(receiving.inbound.taken(), 0u) << "nor does it count for resume";
  }
}

/// `abruptly`: by a reset in place of an end.
void cut_connection(FakeConnection& connection, std::size_t bytes, bool abruptly) {
  connection.send(std::span<const std::byte>(keyed_message()).first(bytes));
  if (abruptly) {
    const linger at_once{1, 0};
    ::setsockopt(connection.descriptor(), SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
  }
  connection.close();
}

TEST(HostileHub, AfterACutTheNodeComesBackAndHasNothingOfIt) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  const std::size_t size = keyed_message().size();
  for (const std::size_t cut :
       {std::size_t{1}, std::size_t{15}, std::size_t{16}, std::size_t{23}, size - 1}) {
    for (const bool abruptly : {false, true}) {
      cut_connection(connected.hub, cut, abruptly);
      connected.hub = hub.admit(make_welcome());
      for (const auto type : {NIF_DISCONNECTED, NIF_CONNECTED}) {
        nif_incoming in{};
        ASSERT_EQ(nif_receive(connected.node.get(), &in, NIF_FOREVER), NIF_OK);
        EXPECT_EQ(in.type, static_cast<std::uint32_t>(type)) << cut;
        nif_release(&in);
      }
    }
  }
}

TEST(HostileHub, FramesWithoutPayloadAreDeliveredEmptyOrEndTheConnection) {
  for (unsigned kind = 0; kind <= 19; ++kind) {
    Receiving receiving;
    proto::FrameHeader header;
    header.kind = static_cast<proto::Kind>(kind);
    header.src = kPeerId;
    header.dst = kind <= 1 || kind == 4 || kind == 7 ? kOwnId : 0;
    if (kind == 3) header.dst = 0xFFFF'FFFF;
    const Inbound::Verdict verdict = receiving.feed(header_bytes(header));
    const bool message = kind <= 4;
    const bool dropped = kind == 5 || (kind >= 7 && kind < 16);
    EXPECT_EQ(verdict, message || dropped ? Inbound::Verdict::going : Inbound::Verdict::malformed)
        << kind;
    EXPECT_EQ(receiving.host.items.size(), message ? 1u : 0u) << kind;
  }
}

TEST(HostileHub, NoHeaderMakesItTakeWhatIsNotThere) {
  // Kinds, flags and lanes in all their combinations, in front of too few bytes for what they
  // promise.
  for (unsigned kind = 0; kind < 20; ++kind) {
    for (unsigned flags = 0; flags < 256; ++flags) {
      for (const unsigned lane : {0u, 3u, 4u, 0xFFu}) {
        proto::FrameHeader header;
        header.kind = static_cast<proto::Kind>(kind);
        header.flags = static_cast<std::uint8_t>(flags);
        header.lane = static_cast<std::uint8_t>(lane);
        header.dst = kOwnId;
        header.src = kPeerId;
        header.length = 3;
        Receiving receiving;
        const Inbound::Verdict verdict = receiving.feed(header_bytes(header, 3));
        const bool of_another_peer = kind < 16 && kind != 6;
        if (of_another_peer) {
          EXPECT_EQ(verdict, Inbound::Verdict::going) << kind << " " << flags;
        }
        EXPECT_LE(receiving.host.items.size(), 1u);
        for (const nif_incoming& in : receiving.host.items) EXPECT_LE(in.size, 3u);
      }
    }
  }
}

// A hub of 0.9.0 passes them on as another hub wrote them, and counts no REPORT for resume.
TEST(HostileHub, AReportThatCannotBeReadCostsNothing) {
  for (unsigned flags = 0; flags < 256; ++flags) {
    for (const unsigned lane : {0u, 1u, 3u, 4u, 255u}) {
      for (std::uint32_t size = 0; size <= 40; ++size) {
        proto::FrameHeader header;
        header.length = size;
        header.dst = kOwnId;
        header.src = kHubNode;
        header.kind = proto::Kind::report;
        header.flags = static_cast<std::uint8_t>(flags);
        header.lane = static_cast<std::uint8_t>(lane);
        std::vector<std::byte> bytes(proto::kHeaderSize + size, std::byte{0x1f});
        proto::store_header(bytes.data(), header);
        add_frame(bytes, message_parts(), "behind");
        Receiving receiving;
        ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going) << flags << ' ' << size;
        const bool readable = size >= proto::kReportSizeMin && lane < 4 && (flags & 0x38) == 0;
        EXPECT_EQ(receiving.inbound.counts().unreadable, readable ? 0u : 1u) << flags;
        EXPECT_EQ(receiving.inbound.counts().frames, 2u);
        EXPECT_EQ(receiving.inbound.taken(), 1u) << "the message behind it";
        EXPECT_EQ(receiving.host.texts(), std::vector<std::string>{"behind"});
      }
    }
  }
}

TEST(HostileHub, TheWrongByteOrderOfAnyFieldCostsAtMostTheConnection) {
  const Bytes whole = keyed_message();
  for (std::size_t field = 0; field < 12; field += 4) {
    Bytes swapped = whole;
    std::reverse(swapped.begin() + static_cast<std::ptrdiff_t>(field),
                 swapped.begin() + static_cast<std::ptrdiff_t>(field + 4));
    Receiving receiving;
    const Inbound::Verdict verdict = receiving.feed(swapped);
    EXPECT_EQ(verdict, field == 0 ? Inbound::Verdict::malformed : Inbound::Verdict::going) << field;
    EXPECT_EQ(receiving.host.items.size(), field == 8 ? 1u : 0u)
        << "to another node, or from whom the hub says";
  }
}

TEST(HostileHub, EventsThatLieEndTheConnectionOrAreSkipped) {
  for (const Bytes& body : hostile_bodies()) {
    for (const std::uint16_t operation : kEvents) {
      Receiving receiving;
      Bytes bytes;
      add_control(bytes, proto::Kind::ns, control(operation, 0, body));
      const Inbound::Verdict verdict = receiving.feed(bytes);
      EXPECT_NE(verdict, Inbound::Verdict::goodbye);
      EXPECT_EQ(verdict == Inbound::Verdict::malformed, !receiving.inbound.fault().empty());
      EXPECT_LE(receiving.host.items.size(), 1u);
    }
  }
}

TEST(HostileHub, AnEventThatIsCutAnywhereEndsTheConnection) {
  proto::ns::ServiceMoved moved;
  moved.name = "robot/odom";
  moved.group = GroupId{kPeerId};
  const proto::Payload whole = proto::encode(moved);
  for (std::size_t cut = 0; cut < whole.size(); ++cut) {
    Receiving receiving;
    Bytes bytes;
    add_control(bytes, proto::Kind::ns,
                proto::Payload(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(cut)));
    const Inbound::Verdict verdict = receiving.feed(bytes);
    EXPECT_TRUE(verdict == Inbound::Verdict::malformed || receiving.host.items.size() <= 1) << cut;
    const bool headless = cut < proto::kControlHeaderSize;
    EXPECT_TRUE(!headless || verdict == Inbound::Verdict::malformed) << cut;
  }
}

TEST(HostileHub, NoWelcomeThatLiesIsTaken) {
  for (const Bytes& body : hostile_bodies()) {
    Bytes bytes(proto::kOpening.begin(), proto::kOpening.end());
    add_control(bytes, proto::Kind::link, control(proto::Welcome::kOperation, 0, body));
    net::DialHandshake handshake;
    if (handshake.take(bytes) == net::DialHandshake::State::welcome) {
      EXPECT_FALSE(session_terms_of(handshake.welcome(), true, 0x1234));
    } else {
      EXPECT_NE(handshake.error().sentence, "");
    }
  }
}

/// Answers each request with the next body, round and round, until the node sends a message.
void answer_all(FakeConnection& hub, const std::vector<Bytes>& bodies) {
  for (std::size_t i = 0;; ++i) {
    const auto frame = hub.next_message();
    ASSERT_TRUE(frame);
    if (frame->header.kind == proto::Kind::unicast) return;
    const auto asked = proto::split_control(frame->view().payload);
    ASSERT_TRUE(asked);
    const auto operation = static_cast<std::uint16_t>(asked->header.operation | proto::kAnswerBit);
    hub.send_control(frame->header.kind,
                     control(operation, asked->header.request, bodies[i % bodies.size()]));
  }
}

TEST(HostileHub, AnswersThatLieFailTheCallAndNothingElse) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome());
  nif_node* const node = connected.node.get();
  const std::vector<Bytes> bodies = hostile_bodies();
  std::thread answering([&] { answer_all(connected.hub, bodies); });
  // Four calls a round, and a number of bodies that is no multiple of four: each call gets them
  // all.
  ASSERT_EQ(bodies.size() % 2, 1u);
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    // Whatever such an answer may be taken for, it is not more than it holds.
    nif_node_list* nodes = nullptr;
    const nif_status listed = nif_list_nodes(node, nullptr, &nodes, NIF_FOREVER);
    EXPECT_LE(listed == NIF_OK ? nodes->count : 0, 1u);
    nif_free_nodes(nodes);
    nif_service_list* services = nullptr;
    const nif_status found = nif_list_services(node, nullptr, &services, NIF_FOREVER);
    EXPECT_LE(found == NIF_OK ? services->count : 0, 1u);
    nif_free_services(services);
    std::uint32_t id = 0;
    static_cast<void>(nif_resolve(node, ("n" + std::to_string(i)).c_str(), &id, NIF_FOREVER));
    static_cast<void>(nif_subscribe(node, "a/b", nullptr, NIF_FOREVER));
  }
  EXPECT_EQ(nif_send_to(node, kPeerId, "done", 4), NIF_OK);
  answering.join();
  connected.hub.send_unicast(kPeerId, kOwnId, "still here");
  nif_incoming in{};
  ASSERT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_OK);
  EXPECT_EQ(payload_of(in), "still here");
  nif_release(&in);
}

TEST(HostileHub, AnswersNobodyAskedForAreSkipped) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  for (unsigned request = 0; request < 1000; ++request) {
    const auto operation = static_cast<std::uint16_t>((request % 40) | proto::kAnswerBit);
    connected.hub.send_control(
        request % 2 == 0 ? proto::Kind::ns : proto::Kind::ctrl,
        control(operation, static_cast<std::uint16_t>(request), Bytes(8, std::byte{1})));
  }
  connected.hub.send_unicast(kPeerId, kOwnId, "still here");
  nif_incoming in{};
  ASSERT_EQ(nif_receive(connected.node.get(), &in, NIF_FOREVER), NIF_OK);
  EXPECT_EQ(in.type, static_cast<std::uint32_t>(NIF_MESSAGE)) << in.text;
  nif_release(&in);
}

}  // namespace
}  // namespace gimnet::nif::test
