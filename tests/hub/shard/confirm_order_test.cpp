#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "tests/hub/shard/support/hub_rig.hpp"

// CONFIRM goes behind the frames that it counts.

namespace gimnet::hub {
namespace {

using ::testing::ElementsAre;
using testing::FakeNode;
using testing::HubRig;

/// A stream that writes its name into a log each time that something is sent over it.
class LoggingStream final : public net::Stream {
 public:
  LoggingStream(std::unique_ptr<net::Stream> inner, std::string& log, char name)
      : inner_(std::move(inner)), log_(log), name_(name) {}

  [[nodiscard]] net::IoResult receive(std::span<std::byte> into) override {
    return inner_->receive(into);
  }
  [[nodiscard]] net::IoResult send(std::span<const iovec> pieces) override {
    log_ += name_;
    return inner_->send(pieces);
  }
  void shut_down() override { inner_->shut_down(); }
  [[nodiscard]] std::uint64_t unsent_bytes() const override { return inner_->unsent_bytes(); }
  void limit_unsent(std::uint32_t bytes) override { inner_->limit_unsent(bytes); }
  void limit_unacknowledged(std::uint32_t ms) override { inner_->limit_unacknowledged(ms); }
  [[nodiscard]] int descriptor() const override { return inner_->descriptor(); }

 private:
  std::unique_ptr<net::Stream> inner_;
  std::string& log_;
  const char name_;
};

/// A node with resume, which is to hear CONFIRM after 1 KiB.
FakeNode& join_logged(HubRig& rig, std::string& log, char name) {
  const auto number = static_cast<std::uint32_t>(name);
  auto [pipe, peer] = make_memory_pipe();
  FakeNode node;
  node.id = make_id<NodeId>(rig.hub(), number);
  node.session = {ConnectionSlot{number}, number};
  node.attachment = 1;
  node.pipe = std::move(peer);
  AttachCommand command;
  command.session = node.session;
  command.attachment = 1;
  command.node = node.id;
  command.transport = std::make_unique<LoggingStream>(std::move(pipe), log, name);
  command.resume_wanted = true;
  command.peer_epoch = 77;
  command.peer_resume_bytes = 4 * 1'024;
  command.peer_frame_bytes = proto::kFrameLengthDefault;
  rig.command(0, std::move(command));
  rig.nodes().publish(number, {node.shard, node.session.slot, node.session.generation});
  rig.turn();
  return rig.adopt(std::move(node));
}

TEST(ConfirmOrder, FramesAreDeliveredBeforeTheyAreConfirmed) {
  HubRig rig;
  std::string log;
  FakeNode& a = join_logged(rig, log, 'a');
  FakeNode& b = join_logged(rig, log, 'b');
  rig.settle();
  log.clear();
  rig.send(a, b.id.value(), std::string(2'000, 'x'));
  rig.turn();
  EXPECT_EQ(log, "ba");
  a.read();
  EXPECT_THAT(a.flow_of<proto::flow::Confirm>(), ElementsAre(proto::flow::Confirm{1}));
  log.clear();
  for (int i = 0; i < 2; ++i) {
    rig.send(a, b.id.value(), std::string(2'000, 'x'));
    rig.send(b, a.id.value(), std::string(2'000, 'x'));
    rig.turn();
  }
  EXPECT_EQ(log.size(), 8u) << "data and CONFIRM, twice each";
  EXPECT_TRUE(log.starts_with("ba") || log.starts_with("ab")) << log;
}

}  // namespace
}  // namespace gimnet::hub
