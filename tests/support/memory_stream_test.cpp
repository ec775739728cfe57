#include "tests/support/memory_stream.hpp"

#include <gtest/gtest.h>

#include <array>
#include <string>

namespace gimnet::hub {
namespace {

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text));
}

std::string read_all(MemoryPeer& peer) {
  std::vector<std::byte> bytes;
  peer.read(bytes);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

net::IoResult send(net::Stream& transport, std::string text) {
  const iovec piece{text.data(), text.size()};
  return transport.send({&piece, 1});
}

std::string receive(net::Stream& transport, std::size_t most = 64) {
  std::vector<std::byte> bytes(most);
  const net::IoResult result = transport.receive(bytes);
  return {reinterpret_cast<const char*>(bytes.data()), result.bytes};
}

TEST(MemoryStream, CarriesBytesBothWaysInOrder) {
  auto [transport, peer] = make_memory_pipe();
  EXPECT_EQ(receive(*transport), "");
  peer.write(bytes_of("abc"));
  peer.write(bytes_of("def"));
  EXPECT_EQ(receive(*transport, 4), "abcd");
  EXPECT_EQ(receive(*transport, 4), "ef");
  EXPECT_EQ(send(*transport, "uvw").bytes, 3u);
  EXPECT_EQ(send(*transport, "xyz").bytes, 3u);
  EXPECT_EQ(transport->unsent_bytes(), 6u);
  EXPECT_EQ(read_all(peer), "uvwxyz");
  EXPECT_EQ(transport->unsent_bytes(), 0u);
}

TEST(MemoryStream, GathersPiecesAndCutsThemAtAnyByte) {
  for (std::size_t cut = 1; cut <= 6; ++cut) {
    auto [transport, peer] = make_memory_pipe();
    peer.plan_sends({cut});
    std::string first = "abc";
    std::string second = "def";
    const std::array pieces{iovec{first.data(), 3}, iovec{second.data(), 3}};
    const net::IoResult result = transport->send(pieces);
    EXPECT_EQ(result.status, net::IoStatus::ok);
    EXPECT_EQ(result.bytes, cut);
    EXPECT_EQ(read_all(peer), std::string("abcdef").substr(0, cut));
  }
}

TEST(MemoryStream, BlocksWhereItIsTold) {
  auto [transport, peer] = make_memory_pipe();
  peer.plan_sends({0, 2, 0});
  EXPECT_EQ(send(*transport, "abc").status, net::IoStatus::would_block);
  EXPECT_EQ(send(*transport, "abc").bytes, 2u);
  EXPECT_EQ(send(*transport, "c").status, net::IoStatus::would_block);
  EXPECT_EQ(send(*transport, "c").bytes, 1u);
  EXPECT_EQ(read_all(peer), "abc");
  peer.plan_receives({0, 1});
  peer.write(bytes_of("xyz"));
  EXPECT_EQ(receive(*transport), "");
  EXPECT_EQ(receive(*transport), "x");
  EXPECT_EQ(receive(*transport), "yz");
}

TEST(MemoryStream, TakesAsMuchAsThereIsRoomAndOneMoreBlocks) {
  auto [transport, peer] = make_memory_pipe();
  peer.set_room(4);
  EXPECT_EQ(send(*transport, "abcd").bytes, 4u);
  EXPECT_FALSE(peer.transport_writable());
  EXPECT_EQ(send(*transport, "e").status, net::IoStatus::would_block);
  std::vector<std::byte> some;
  EXPECT_EQ(peer.read(some, 1), 1u);
  EXPECT_TRUE(peer.transport_writable());
  EXPECT_EQ(send(*transport, "ef").bytes, 1u);
}

TEST(MemoryStream, EndsInOrderAfterEverythingWasRead) {
  auto [transport, peer] = make_memory_pipe();
  peer.write(bytes_of("ab"));
  peer.close();
  std::array<std::byte, 8> into{};
  EXPECT_TRUE(peer.transport_readable());
  EXPECT_EQ(transport->receive(into).bytes, 2u);
  EXPECT_EQ(transport->receive(into).status, net::IoStatus::closed);
  transport.reset();
  EXPECT_TRUE(peer.transport_gone());
}

TEST(MemoryStream, FailsAfterAReset) {
  auto [transport, peer] = make_memory_pipe();
  peer.write(bytes_of("ab"));
  peer.reset();
  std::array<std::byte, 8> into{};
  EXPECT_EQ(transport->receive(into).status, net::IoStatus::failed);
  EXPECT_EQ(send(*transport, "x").status, net::IoStatus::failed);
}

TEST(MemoryStream, FailsAfterSoManyBytes) {
  auto [transport, peer] = make_memory_pipe();
  peer.reset_after(4);
  EXPECT_EQ(send(*transport, "abc").bytes, 3u);
  EXPECT_EQ(send(*transport, "def").bytes, 1u);
  EXPECT_EQ(send(*transport, "ef").status, net::IoStatus::failed);
  EXPECT_EQ(read_all(peer), "abcd");
}

TEST(MemoryStream, RemembersTheBoundOfWhatIsUnsent) {
  auto [transport, peer] = make_memory_pipe();
  transport->limit_unsent(4096);
  EXPECT_EQ(peer.unsent_limit(), 4096u);
  EXPECT_EQ(transport->descriptor(), -1);
}

}  // namespace
}  // namespace gimnet::hub
