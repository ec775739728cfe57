#include "tests/net/support/toy_stream.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>

#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "tests/net/support/connected_sockets.hpp"

namespace gimnet::net {
namespace {

using Family = SocketStream::Family;

/// Two toy streams that talk to each other.
struct Talk {
  Talk() {
    const ConnectedSockets ends = connect_by_unix();
    near = std::make_unique<ToyStream>(
        std::make_unique<SocketStream>(ends.near, Family::unix_socket, SocketOptions{0, 4'096}));
    far =
        std::make_unique<ToyStream>(std::make_unique<SocketStream>(ends.far, Family::unix_socket));
  }
  std::unique_ptr<ToyStream> near;
  std::unique_ptr<ToyStream> far;
};

std::vector<std::byte> receive(Stream& stream, std::size_t most) {
  std::vector<std::byte> bytes(most);
  const IoResult result = stream.receive(bytes);
  bytes.resize(result.bytes);
  return bytes;
}

std::vector<std::byte> pattern(std::size_t size) {
  std::vector<std::byte> bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = std::byte(i * 7);
  return bytes;
}

iovec piece(std::vector<std::byte>& bytes) { return {bytes.data(), bytes.size()}; }

TEST(ToyStream, KeepsBytesThatNoPollerShows) {
  Talk talk;
  std::vector<std::byte> said = pattern(20);
  const iovec one = piece(said);
  ASSERT_EQ(talk.near->send({&one, 1}).bytes, 20u);
  EXPECT_EQ(receive(*talk.far, 5).size(), 5u);
  EXPECT_EQ(talk.far->pending_in(), 15u);
  char nothing = 0;
  EXPECT_LT(::recv(talk.far->descriptor(), &nothing, 1, MSG_DONTWAIT), 0);
  EXPECT_EQ(receive(*talk.far, 100), std::vector<std::byte>(said.begin() + 5, said.end()));
  EXPECT_EQ(talk.far->pending_in(), 0u);
}

TEST(ToyStream, FinishesARecordThatTheKernelTookInPartAndThenEnds) {
  Talk talk;
  std::vector<std::byte> said = pattern(200'000);
  std::vector<std::byte> heard;
  std::size_t sent = 0;
  while (heard.size() < said.size()) {
    if (sent < said.size()) {
      const iovec rest{said.data() + sent, said.size() - sent};
      sent += talk.near->send({&rest, 1}).bytes;
    } else {
      talk.near->shut_down();
    }
    static_cast<void>(talk.near->send({}));
    const auto more = receive(*talk.far, 100'000);
    heard.insert(heard.end(), more.begin(), more.end());
  }
  EXPECT_EQ(heard, said);
  while (talk.near->pending_out() != 0) static_cast<void>(talk.near->send({}));
  talk.near->shut_down();
  std::array<std::byte, 4> room;
  EXPECT_EQ(talk.far->receive(room).status, IoStatus::closed);
}

TEST(ToyStream, ReadingMakesOutputOfItsOwn) {
  Talk talk;
  std::vector<std::byte> said = pattern(64 * ToyCode::kPayload);
  const iovec one = piece(said);
  ASSERT_EQ(talk.near->send({&one, 1}).bytes, said.size());
  EXPECT_EQ(receive(*talk.far, said.size()), said);
  std::array<std::byte, 32> raw;
  EXPECT_EQ(::recv(talk.near->descriptor(), raw.data(), raw.size(), MSG_DONTWAIT), 16);
}

}  // namespace
}  // namespace gimnet::net
