#include "client/nif/parked_frames.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/client/nif/support/frames.hpp"

namespace gimnet::nif::test {
namespace {

constexpr std::uint32_t kNewId = 77;

void put_group(SendQueue& queue, std::uint8_t lane, std::uint32_t group, std::string_view payload,
               bool replaceable = false) {
  proto::FrameHeader header;
  header.kind = proto::Kind::group;
  header.lane = lane;
  header.dst = group;
  const auto frame = frame_of(header, payload);
  const auto memory =
      replaceable ? queue.append_latest(lane, frame.size(), latest_stream_of(header, std::nullopt))
                  : queue.append(lane, frame.size());
  std::memcpy(memory.data(), frame.data(), frame.size());
}

/// "group payload" of each frame; all are from kNewId.
std::vector<std::string> groups(const std::vector<std::byte>& bytes) {
  std::vector<std::string> found;
  for (std::size_t at = 0; at < bytes.size();) {
    const proto::FrameHeader header = proto::load_header(bytes.data() + at);
    EXPECT_EQ(header.src, kNewId);
    const auto* payload = reinterpret_cast<const char*>(bytes.data() + at + proto::kHeaderSize);
    found.push_back(std::to_string(header.dst) + " " + std::string(payload, header.length));
    at += header.frame_size();
  }
  return found;
}

using Texts = std::vector<std::string>;

TEST(ParkedFrames, WaitUntilTheirServiceIsDeclaredAndGoFirst) {
  SendQueue queue({});
  queue.set_resume(true);
  put_group(queue, NIF_NORMAL, 1, "a");
  put(queue, NIF_NORMAL, "to a node");
  put_group(queue, NIF_NORMAL, 2, "b");
  put_group(queue, NIF_NORMAL, 1, "c");
  put_group(queue, NIF_BULK, 1, "d");
  put_group(queue, NIF_NORMAL, 2, "old", true);
  put_group(queue, NIF_NORMAL, 2, "latest", true);
  const std::size_t bytes = queue.unsent_bytes();
  queue.disconnect();
  queue.restart(kNewId);
  EXPECT_EQ(queue.unsent_bytes() + queue.parked_bytes(), bytes);
  EXPECT_EQ(groups(write_all(queue)), (Texts{"0 to a node"}));
  EXPECT_FALSE(queue.release_group(3, 4));
  put_group(queue, NIF_NORMAL, 2, "newer");
  EXPECT_TRUE(queue.release_group(1, 2)) << "each has the other's group now";
  EXPECT_TRUE(queue.release_group(2, 1));
  EXPECT_EQ(queue.parked_bytes(), 0u);
  queue.set_source(kNewId);
  EXPECT_EQ(groups(write_all(queue)), (Texts{"1 b", "1 latest", "2 a", "2 c", "2 newer", "2 d"}));
  EXPECT_TRUE(queue.all_written());
}

TEST(ParkedFrames, WaitOverFurtherBreaks) {
  SendQueue queue({});
  queue.set_resume(true);
  put_group(queue, NIF_NORMAL, 1, "begun before the break");
  static_cast<void>(write_once(queue, 5));
  queue.disconnect();
  queue.restart(5);
  EXPECT_TRUE(queue.all_written());
  put_group(queue, NIF_NORMAL, 1, "later");
  queue.disconnect();
  queue.restart(kNewId);
  EXPECT_TRUE(queue.all_written());
  EXPECT_TRUE(queue.release_group(1, 1));
  EXPECT_EQ(groups(write_all(queue)), (Texts{"1 begun before the break", "1 later"}));
}

TEST(ParkedFrames, AreCountedWhenTheyGo) {
  SendQueue queue({});
  queue.set_resume(true);
  for (const char* payload : {"a", "b", "c"}) put_group(queue, NIF_NORMAL, 1, payload);
  put_group(queue, NIF_NORMAL, 2, "d");
  queue.restart(kNewId);
  EXPECT_TRUE(queue.release_group(2, 2));
  EXPECT_EQ(queue.drop_parked(), 3u);
  EXPECT_EQ(queue.drop_parked(), 0u);
  EXPECT_EQ(queue.parked_bytes(), 0u);
  EXPECT_EQ(groups(write_all(queue)), (Texts{"2 d"}));
  put_group(queue, NIF_NORMAL, 1, "e");
  queue.restart(kNewId);
  EXPECT_EQ(queue.drop_all(), 1u);
  EXPECT_FALSE(queue.release_group(1, 1));
}

}  // namespace
}  // namespace gimnet::nif::test
