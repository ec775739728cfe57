#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>

#include "client/gimi/core.hpp"
#include "proto/gimi/message_header.hpp"
#include "proto/gimi/request.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

// Requests that take a while to leave, since the hub does not read on.

namespace gimnet::gimi {
namespace {

using nif::test::kPeerId;
using proto::gimi::MessageOperation;

constexpr const char* kService = "calc/add";
constexpr ServicePlace kThere{
    .group = 9, .provider = kPeerId, .session = 3, .key = {7, 1}, .accepts = true};

class LargeRequest : public testing::Test {
 protected:
  LargeRequest() {
    NodeOptions options;
    options.hub = fake_.url();
    options.reconnect = false;
    std::thread joining([&] { core_ = Core::join(options).or_throw(); });
    hub_ = fake_.admit(nif::test::make_welcome());
    joining.join();
    core_->requests().learn(kService, nullptr, kThere);
  }
  ~LargeRequest() override { hub_.close(); }

  void answer(std::uint32_t from, MessageOperation operation, std::span<const std::byte> data) {
    std::array<std::byte, proto::gimi::kMessagePrefixMax> prefix;
    const std::size_t size = proto::gimi::write_message_prefix(
        {asked_.sequence, operation, 0, 0, asked_.epoch}, std::nullopt, prefix);
    std::string payload(reinterpret_cast<const char*>(prefix.data()), size);
    payload.append(reinterpret_cast<const char*>(data.data()), data.size());
    proto::FrameParts parts;
    parts.header.kind = proto::Kind::unicast;
    parts.header.dst = nif::test::kOwnId;
    parts.header.src = from;
    parts.key = proto::gimi::StreamKey{kThere.key.type, kThere.key.instance}.value();
    hub_.send(parts, payload);
  }
  /// The first frame of a request.
  void take_first() {
    const auto frame = hub_.next_message();
    ASSERT_TRUE(frame);
    const auto message = proto::gimi::parse_message(frame->view().payload);
    ASSERT_TRUE(message);
    asked_ = message->header;
    EXPECT_EQ(asked_.operation, MessageOperation::request);
  }
  /// Reads on to its end. False: that does not come.
  bool take_rest() {
    const auto deadline = std::chrono::steady_clock::now() + nif::test::kPatience;
    while (std::chrono::steady_clock::now() < deadline) {
      const auto frame = hub_.next();
      if (!frame) return false;
      const proto::FrameView view = frame->view();
      if (view.fragment && view.fragment->offset + view.payload.size() == view.fragment->total)
        return true;
    }
    return false;
  }

  nif::test::FakeHub fake_;
  nif::test::FakeConnection hub_{-1};
  std::shared_ptr<Core> core_;
  proto::gimi::MessageHeader asked_;
};

// The numbers of requests are easily guessed: all of a node have one epoch.
TEST_F(LargeRequest, IsNotGivenUpForTheErrorOfAnotherNode) {
  OpenRequests& requests = core_->requests();
  const std::string large(std::size_t{32} << 20, 'x');  // more than the connection holds
  std::optional<Ended> ended;
  std::thread asking([&] {
    const std::uint32_t number = requests.open(kService, large, INT64_MAX, {}).or_throw();
    ended = requests.wait(number, INT64_MAX);
  });
  take_first();
  const auto error =
      proto::gimi::encode_request_error({proto::gimi::RequestFault::too_large, 0, "no"});
  // Once the second one is counted all is done that the first one does.
  for (int i = 0; i < 2; ++i) answer(kPeerId + 1, MessageOperation::error, error);
  while (requests.dropped() != 2) std::this_thread::yield();
  EXPECT_TRUE(take_rest());
  answer(kPeerId, MessageOperation::reply, {});
  asking.join();
  ASSERT_TRUE(ended);
  EXPECT_EQ(ended->status, Status::ok) << ended->sentence;
}

}  // namespace
}  // namespace gimnet::gimi
