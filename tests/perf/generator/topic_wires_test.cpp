#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>

#include "generator/mqtt_wire.hpp"
#include "generator/nats_wire.hpp"
#include "generator/publisher.hpp"
#include "generator/resp_wire.hpp"
#include "generator/topic.hpp"
#include "generator/zmtp_wire.hpp"

// The wires of the other hubs: every byte that they write is what the protocol's own document says,
// and what those hubs send is read however it is split.

namespace gimnet::perf {
namespace {

using namespace std::string_literals;

/// A client whose other end is in the test's hands.
class Peer {
 public:
  explicit Peer(std::size_t index) : Peer(index, pair()) {}
  ~Peer() { ::close(other_); }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  Client client;

  /// What the client has written since the last call.
  std::string written() {
    std::string text(1024, '\0');
    const ssize_t size = ::recv(other_, text.data(), text.size(), MSG_DONTWAIT);
    text.resize(static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
    return text;
  }

 private:
  struct Sockets {
    int mine;
    int other;
  };
  Peer(std::size_t index, Sockets sockets) : client(index, sockets.mine), other_(sockets.other) {}
  static Sockets pair() {
    int sockets[2];
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, sockets), 0);
    return {sockets[0], sockets[1]};
  }

  const int other_;
};

std::size_t give(Wire& wire, Client& client, const std::string& text) {
  return wire.take(client, as_bytes(text));
}

/// What the wire makes of a message of 16 bytes; the stamp is that of the first message of
/// stream 5.
std::string published(Wire& wire, const Target& target) {
  const Client from{9, ::socket(AF_UNIX, SOCK_STREAM, 0)};
  MessageBlock block;
  wire.append_message(from, target, 1, pattern_payload(16), block);
  block.renew();
  return std::string{as_text(block.bytes)};
}

std::string payload() {
  std::string text{as_text(pattern_payload(16))};
  text[6] = 5;  // the stream, in the stamp's upper 16 bits
  return text;
}

Target to(const Client& client) {
  return {.kind = Target::Kind::unicast, .recipients = {&client}, .stream = 5};
}
const Target& to_group() {
  static const Target target{.kind = Target::Kind::group, .recipients = {}, .stream = 5};
  return target;
}

/// Three messages in a row, cut at every byte: each arrives once.
void expect_read_however_split(Wire& wire, Client& client, const std::string& one) {
  const std::string three = one + one + one;
  for (std::size_t split = 0; split <= three.size(); ++split) {
    client.inbox = {};
    client.inbox.expect(5, 16);
    const std::size_t done = give(wire, client, three.substr(0, split));
    EXPECT_LE(done, split);
    EXPECT_EQ(done + give(wire, client, three.substr(done)), three.size());
    // All three bear number 0: the first is right, the repetitions are not.
    EXPECT_EQ(client.inbox.delivered(), 1u) << split;
    EXPECT_EQ(client.inbox.wrong(), 2u) << split;
  }
}

TEST(NatsWire, JoinsPublishesAndReads) {
  NatsWire wire;
  Peer peer(3);
  wire.open(peer.client);
  EXPECT_EQ(
      peer.written(),
      "CONNECT "
      "{\"verbose\":false,\"pedantic\":false,\"tls_required\":false,\"name\":\"\",\"lang\":\"raw\","
      "\"version\":\"1\",\"protocol\":1}\r\nSUB n3 1\r\nPING\r\n");
  EXPECT_EQ(give(wire, peer.client, "INFO {\"max_payload\":1048576}\r\nPO"), 30u);
  EXPECT_FALSE(peer.client.is_joined);
  EXPECT_EQ(give(wire, peer.client, "PONG\r\n"), 6u);
  EXPECT_TRUE(peer.client.is_joined);
  EXPECT_FALSE(peer.client.is_in_group);
  wire.subscribe(peer.client);
  EXPECT_EQ(peer.written(), "SUB g 2\r\nPING\r\n");
  EXPECT_EQ(give(wire, peer.client, "PONG\r\nPING\r\n"), 12u);
  EXPECT_TRUE(peer.client.is_in_group);
  EXPECT_EQ(peer.written(), "PONG\r\n");
  EXPECT_EQ(published(wire, to(peer.client)), "PUB n3 16\r\n" + payload() + "\r\n");
  EXPECT_EQ(published(wire, to_group()), "PUB g 16\r\n" + payload() + "\r\n");
  expect_read_however_split(wire, peer.client, "MSG n3 1 16\r\n" + payload() + "\r\n");
}

TEST(NatsWire, SeesAMessageThatDoesNotEndWhereItShould) {
  NatsWire wire;
  Peer peer(3);
  peer.client.inbox.expect(5, 16);
  give(wire, peer.client, "MSG n3 1 16\r\n" + payload() + "xx");
  EXPECT_EQ(peer.client.inbox.wrong(), 1u);
}

TEST(MqttWire, JoinsPublishesAndReads) {
  MqttWire wire;
  Peer peer(3);
  wire.open(peer.client);
  EXPECT_EQ(peer.written(), "\x10\x0E\0\4MQTT\4\2\x0E\x10\0\2c3"s + "\x82\7\0\1\0\2n3\0"s);
  EXPECT_EQ(give(wire, peer.client, "\x20\2\0\0\x90\3\0\1"s), 4u);
  EXPECT_FALSE(peer.client.is_joined);
  EXPECT_EQ(give(wire, peer.client, "\x90\3\0\1\0"s), 5u);
  EXPECT_TRUE(peer.client.is_joined);
  wire.subscribe(peer.client);
  EXPECT_EQ(peer.written(), "\x82\6\0\2\0\1g\0"s);
  EXPECT_EQ(give(wire, peer.client, "\x90\3\0\2\0"s), 5u);
  EXPECT_TRUE(peer.client.is_in_group);
  const std::string message = "\x30\x14\0\2n3"s + payload();
  EXPECT_EQ(published(wire, to(peer.client)), message);
  EXPECT_EQ(published(wire, to_group()), "\x30\x13\0\1g"s + payload());
  expect_read_however_split(wire, peer.client, message);
}

TEST(MqttWire, WritesAndReadsLengthsOfEverySize) {
  MqttWire wire;
  Peer peer(3);
  for (const std::size_t size : {123u, 124u, 16'379u, 16'380u, 1'048'576u}) {
    const Client from{9, ::socket(AF_UNIX, SOCK_STREAM, 0)};
    MessageBlock block;
    wire.append_message(from, to(peer.client), 1, pattern_payload(size), block);
    block.renew();
    const std::size_t length_bytes = size + 4 < 128 ? 1 : size + 4 < 16'384 ? 2 : 3;
    EXPECT_EQ(block.bytes.size(), 1 + length_bytes + 4 + size);
    peer.client.inbox = {};
    peer.client.inbox.expect(5, size);
    EXPECT_EQ(wire.take(peer.client, std::span(block.bytes).first(block.bytes.size() - 1)), 0u);
    EXPECT_EQ(wire.take(peer.client, block.bytes), block.bytes.size());
    EXPECT_EQ(peer.client.inbox.delivered(), 1u) << size;
  }
}

TEST(RespWire, JoinsPublishesAndReads) {
  RespWire wire;
  Peer peer(3);
  wire.open(peer.client);
  EXPECT_EQ(peer.written(),
            "*2\r\n$5\r\nHELLO\r\n$1\r\n3\r\n*2\r\n$9\r\nSUBSCRIBE\r\n$2\r\nn3\r\n"
            "*3\r\n$6\r\nCLIENT\r\n$5\r\nREPLY\r\n$3\r\nOFF\r\n");
  const std::string hello = "%2\r\n$6\r\nserver\r\n$5\r\nredis\r\n$7\r\nmodules\r\n*1\r\n*0\r\n";
  for (std::size_t split = 0; split < hello.size(); ++split) {
    EXPECT_EQ(give(wire, peer.client, hello.substr(0, split)), 0u) << split;
  }
  EXPECT_EQ(give(wire, peer.client, hello), hello.size());
  EXPECT_FALSE(peer.client.is_joined);
  give(wire, peer.client, ">3\r\n$9\r\nsubscribe\r\n$2\r\nn3\r\n:1\r\n");
  EXPECT_TRUE(peer.client.is_joined);
  wire.subscribe(peer.client);
  EXPECT_EQ(peer.written(), "*2\r\n$9\r\nSUBSCRIBE\r\n$1\r\ng\r\n");
  give(wire, peer.client, ">3\r\n$9\r\nsubscribe\r\n$1\r\ng\r\n:2\r\n:1\r\n");
  EXPECT_TRUE(peer.client.is_in_group);
  EXPECT_EQ(published(wire, to(peer.client)),
            "*3\r\n$7\r\nPUBLISH\r\n$2\r\nn3\r\n$16\r\n" + payload() + "\r\n");
  EXPECT_EQ(published(wire, to_group()),
            "*3\r\n$7\r\nPUBLISH\r\n$1\r\ng\r\n$16\r\n" + payload() + "\r\n");
  expect_read_however_split(wire, peer.client,
                            ">3\r\n$7\r\nmessage\r\n$2\r\nn3\r\n$16\r\n" + payload() + "\r\n");
}

std::string zmtp_greeting(const std::string& socket_type) {
  std::string bytes = "\xFF\0\0\0\0\0\0\0\0\x7F\3\0NULL"s;
  bytes.resize(64, '\0');
  return bytes + "\4\x19\5READY\x0BSocket-Type\0\0\0\3"s + socket_type;
}

TEST(ZmtpWire, SubscribesOnceTheProxyIsReady) {
  ZmtpWire wire;
  Peer peer(0x0103);
  wire.open(peer.client);
  EXPECT_EQ(peer.written(), zmtp_greeting("SUB"));
  EXPECT_EQ(give(wire, peer.client, zmtp_greeting("XPU")), 64u + 27u);
  EXPECT_EQ(peer.written(), "\0\4\1n\1\3"s);
  wire.subscribe(peer.client);
  EXPECT_EQ(peer.written(), "\0\4\1g\0\0"s + "\0\4\1s\1\3"s);
  EXPECT_FALSE(peer.client.is_joined);
}

TEST(ZmtpWire, LearnsByThePublishingSideThatSubscriptionsStand) {
  ZmtpWire wire;
  Peer peer(3);
  Peer side(3);
  side.client.is_side = true;
  wire.open(peer.client);
  wire.open_side(side.client);
  EXPECT_EQ(side.written(), zmtp_greeting("PUB"));
  give(wire, side.client, zmtp_greeting("XSU"));
  EXPECT_TRUE(side.client.is_joined);
  EXPECT_EQ(wire.joined_count(), 0u);
  EXPECT_EQ(give(wire, side.client, "\0\4\1n\0\3"s), 6u);
  EXPECT_TRUE(peer.client.is_joined);
  EXPECT_FALSE(peer.client.is_in_group);
  EXPECT_EQ(give(wire, side.client, "\0\4\1g\0\0\0\4\1s\0\3"s), 12u);
  EXPECT_TRUE(peer.client.is_in_group);
  EXPECT_EQ(wire.joined_count(), 1u);
}

TEST(ZmtpWire, PublishesAndReads) {
  ZmtpWire wire;
  Peer peer(3);
  EXPECT_EQ(published(wire, to(peer.client)), "\0\x13n\0\3"s + payload());
  EXPECT_EQ(published(wire, to_group()), "\0\x13g\0\0"s + payload());
  give(wire, peer.client, zmtp_greeting("XPU"));
  expect_read_however_split(wire, peer.client, "\0\x13n\0\3"s + payload());
}

TEST(ZmtpWire, WritesAndReadsLongMessages) {
  ZmtpWire wire;
  Peer peer(3);
  give(wire, peer.client, zmtp_greeting("XPU"));
  for (const std::size_t size : {252u, 253u, 65'536u}) {
    const Client from{9, ::socket(AF_UNIX, SOCK_STREAM, 0)};
    MessageBlock block;
    wire.append_message(from, to(peer.client), 1, pattern_payload(size), block);
    block.renew();
    EXPECT_EQ(block.bytes.size(), (size + 3 <= 255 ? 2 : 9) + 3 + size);
    peer.client.inbox = {};
    peer.client.inbox.expect(5, size);
    EXPECT_EQ(wire.take(peer.client, std::span(block.bytes).first(block.bytes.size() - 1)), 0u);
    EXPECT_EQ(wire.take(peer.client, block.bytes), block.bytes.size());
    EXPECT_EQ(peer.client.inbox.delivered(), 1u) << size;
  }
}

TEST(Publisher, WritesOnItsPublishingSide) {
  NatsWire wire;
  Peer peer(0);
  Peer side(0);
  peer.client.set_publishing_side(side.client);
  Publisher publisher(wire, peer.client, {to(peer.client)}, {.payload_bytes = 16},
                      Writing::unbatched);
  EXPECT_EQ(publisher.publish(1), 1u);
  EXPECT_EQ(peer.written(), "");
  EXPECT_EQ(side.written(), "PUB n0 16\r\n" + payload() + "\r\n");
}

}  // namespace
}  // namespace gimnet::perf
