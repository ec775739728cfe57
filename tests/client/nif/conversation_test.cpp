#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "gimnet/nif.h"
#include "proto/control/ns.hpp"
#include "proto/control/ns_watch.hpp"
#include "tests/client/nif/support/fake_hub.hpp"
#include "tests/vectors/vector_file.hpp"

// A conversation with a hub of version 1, as it was recorded (tests/vectors/conversation): what that hub said is
// understood by the library of today, frame by frame, and what the library says is what was said then.

namespace gimnet::nif::test {
namespace {

using gimnet::test::Bytes;
namespace ns = proto::ns;

constexpr std::int32_t kPatienceMs = 20'000;

struct Step {
  bool from_hub = false;
  Bytes bytes;

  [[nodiscard]] bool is_opening() const { return bytes.size() == proto::kOpeningSize; }
  [[nodiscard]] proto::FrameHeader header() const { return proto::load_header(bytes.data()); }
  [[nodiscard]] std::span<const std::byte> payload() const { return std::span{bytes}.subspan(proto::kHeaderSize); }
  [[nodiscard]] bool is_request_kind() const {
    return !is_opening() && (header().kind == proto::Kind::ns || header().kind == proto::Kind::ctrl);
  }
  [[nodiscard]] proto::ControlView control() const { return *proto::split_control(payload()); }
  /// The operation of a control frame, without the bit of answers.
  [[nodiscard]] std::uint16_t operation() const {
    return static_cast<std::uint16_t>(control().header.operation & ~proto::kAnswerBit);
  }
  /// The library sees to these by itself, when it likes.
  [[nodiscard]] bool is_of_the_library() const {
    if (is_opening()) return false;
    return header().kind == proto::Kind::flow ||
           (is_request_kind() && operation() == static_cast<std::uint16_t>(ns::WatchTaken::kOperation));
  }
};

/// What was said on one node's connection.
std::vector<Step> steps_of(const std::string& who) {
  std::ifstream file(std::string(GIMNET_VECTORS_DIR) + "/conversation/version_1.txt");
  std::vector<Step> steps;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line.substr(0, line.find('#')));
    std::string speaker;
    std::string sign;
    std::string hex;
    if (!(words >> speaker >> sign) || speaker != who) continue;
    for (std::string word; words >> word;) hex += word;
    steps.push_back({sign == "<", gimnet::test::from_hex(hex)});
  }
  return steps;
}

/// Plays the hub.
class RecordedHub {
 public:
  RecordedHub(const std::vector<Step>& steps, FakeHub& hub) : steps_(steps), hub_(hub) {}

  void play() {
    FakeConnection connection = hub_.accept();
    ASSERT_TRUE(connection.read_hello());
    for (const Step& step : steps_) {
      if (step.is_of_the_library()) continue;
      if (step.from_hub) {
        say(connection, step);
      } else if (!step.is_opening() && step.header().kind != proto::Kind::link) {
        hear(connection, step);
      }
      if (::testing::Test::HasFatalFailure()) return;
    }
    static_cast<void>(connection.wait_closed());
  }

 private:
  void say(FakeConnection& connection, const Step& step) {
    Bytes bytes = step.bytes;
    if (step.is_request_kind() && step.control().header.is_answer()) {
      store_le(bytes.data() + proto::kHeaderSize + 2, numbers_.at(step.control().header.request));
    }
    connection.send(bytes);
  }
  /// The same frame, apart from the request's number and what follows the operation of those that the library words.
  void hear(FakeConnection& connection, const Step& step) {
    std::optional<Frame> frame;
    do {
      frame = connection.next_message();
      ASSERT_TRUE(frame);
    } while (Step{false, frame->bytes}.is_of_the_library());
    EXPECT_EQ(frame->header.kind, step.header().kind);
    EXPECT_EQ(frame->header.dst, step.header().dst);
    EXPECT_EQ(frame->header.src, step.header().src);
    if (!step.is_request_kind()) {
      EXPECT_EQ(frame->bytes, step.bytes);
      return;
    }
    const Step heard{false, frame->bytes};
    EXPECT_EQ(heard.operation(), step.operation());
    numbers_[step.control().header.request] = heard.control().header.request;
  }

  const std::vector<Step>& steps_;
  FakeHub& hub_;
  std::map<std::uint16_t, std::uint16_t> numbers_;  ///< of requests: as recorded, as heard
};

/// Does and expects what the recorded node did and was told.
class RecordedNode {
 public:
  RecordedNode(const std::vector<Step>& steps, nif_node* node) : steps_(steps), node_(node) {}

  void play() {
    for (std::size_t i = 0; i < steps_.size(); ++i) {
      const Step& step = steps_[i];
      SCOPED_TRACE("step " + std::to_string(i));
      if (step.is_opening() || step.is_of_the_library()) continue;
      if (step.from_hub) {
        be_told(step);
      } else if (step.is_request_kind()) {
        ask(step, steps_[i + 1]);
      } else if (step.header().kind != proto::Kind::link) {
        send(step);
      }
      if (::testing::Test::HasFatalFailure()) return;
    }
  }
  [[nodiscard]] std::size_t watched() const { return watched_; }
  [[nodiscard]] std::size_t messages() const { return messages_; }

 private:
  void ask(const Step& step, const Step& answer) {
    const auto done = static_cast<std::uint16_t>(proto::peek_status(answer.payload()));
    if (step.header().kind == proto::Kind::ns && step.operation() == ns::Watch::kOperation) {
      std::uint32_t watch = 0;
      ASSERT_EQ(nif_watch(node_, nullptr, NIF_WATCH_ALL, &watch, kPatienceMs), NIF_OK);
      EXPECT_EQ(watch, proto::decode<ns::Watch>(step.payload())->watch);
    } else if (step.header().kind == proto::Kind::ns && step.operation() == ns::Subscribe::kOperation) {
      const auto wanted = proto::decode<ns::Subscribe>(step.payload());
      const auto said = proto::decode_answer<ns::SubscribeAnswer>(answer.payload());
      nif_subscription subscription{};
      nif_pace pace{};
      pace.struct_size = sizeof pace;
      pace.window = wanted->window;
      pace.depth = wanted->depth;
      ASSERT_EQ(nif_subscribe_paced(node_, wanted->name.c_str(), &pace, &subscription, kPatienceMs), NIF_OK);
      EXPECT_EQ(subscription.group, said->group.value());
      EXPECT_EQ(subscription.message_type, said->message_type);
    } else {
      nif_reply* reply = nullptr;
      const std::span<const std::byte> body = step.control().body;
      ASSERT_EQ(nif_request(node_, static_cast<std::uint8_t>(step.header().kind), step.operation(), body.data(),
                            body.size(), &reply, kPatienceMs),
                NIF_OK);
      EXPECT_EQ(reply->status, done);
      const std::span<const std::byte> said = answer.control().body;
      const auto* content = static_cast<const std::byte*>(reply->content);
      EXPECT_EQ(Bytes(content, content + reply->size), gimnet::test::to_bytes(said));
      nif_free_reply(reply);
    }
  }
  void send(const Step& step) {
    std::span<const std::byte> payload = step.payload();
    nif_outgoing out = NIF_OUTGOING_INIT;
    out.kind = static_cast<std::uint8_t>(step.header().kind);
    out.lane = step.header().lane;
    out.to = step.header().dst;
    if (step.header().has(proto::kFlagKeyed)) {
      out.flags = NIF_FLAG_KEYED;
      out.key = load_le<std::uint64_t>(payload.data());
      payload = payload.subspan(sizeof out.key);
    }
    const nif_bytes part{payload.data(), payload.size()};
    out.parts = &part;
    out.part_count = 1;
    EXPECT_EQ(nif_send(node_, &out, kPatienceMs), NIF_OK);
  }
  void be_told(const Step& step) {
    if (step.is_request_kind() && step.control().header.is_answer()) return;
    if (step.header().kind == proto::Kind::link) {
      if (step.operation() == proto::Welcome::kOperation) return;
      return expect(NIF_DISCONNECTED, [&](const nif_incoming& in) {
        EXPECT_EQ(in.reason, static_cast<std::uint32_t>(proto::decode<proto::Goodbye>(step.payload())->code));
      });
    }
    if (!step.is_request_kind()) {
      ++messages_;
      return expect(NIF_MESSAGE, [&](const nif_incoming& in) {
        EXPECT_EQ(in.from, step.header().src);
        EXPECT_EQ(payload_of(in),
                  std::string_view(reinterpret_cast<const char*>(step.payload().data()), step.payload().size()));
      });
    }
    if (step.operation() == ns::ServiceMoved::kOperation) {
      const auto event = proto::decode<ns::ServiceMoved>(step.payload());
      return expect(NIF_SERVICE_MOVED, [&](const nif_incoming& in) {
        EXPECT_EQ(in.former_group, event->old_group.value());
        EXPECT_EQ(in.group, event->new_group.value());
      });
    }
    ASSERT_EQ(step.operation(), ns::WatchEvents::kOperation);
    const auto events = proto::decode<ns::WatchEvents>(step.payload());
    ASSERT_TRUE(events);
    for (const ns::Change& change : events->changes) {
      ++watched_;
      expect(NIF_WATCHED, [&](const nif_incoming& in) {
        EXPECT_EQ(in.watched->change, static_cast<std::uint32_t>(change.kind));
        EXPECT_EQ(in.watched->version, change.version);
        if (change.node) {
          EXPECT_EQ(in.watched->node->name, change.node->name);
        }
        if (change.service) {
          EXPECT_EQ(in.watched->service->name, change.service->name);
        }
      });
    }
  }
  template <class Check>
  void expect(nif_incoming_type type, Check check) {
    nif_incoming in{};
    ASSERT_EQ(nif_receive(node_, &in, kPatienceMs), NIF_OK);
    EXPECT_EQ(in.type, static_cast<std::uint32_t>(type));
    if (in.type == static_cast<std::uint32_t>(type)) check(in);
    nif_release(&in);
  }

  const std::vector<Step>& steps_;
  nif_node* const node_;
  std::size_t watched_ = 0;
  std::size_t messages_ = 0;
};

TEST(Conversation, WhatAHubOfVersion1SaidIsUnderstood) {
  const std::vector<Step> steps = steps_of("viewer");
  ASSERT_GT(steps.size(), 50u);
  FakeHub hub;
  RecordedHub recorded(steps, hub);
  std::thread playing([&recorded] { recorded.play(); });
  {
    nif_options options = default_options("viewer");
    const std::string url = hub.url();
    options.url = url.c_str();
    nif_node* handle = nullptr;
    EXPECT_EQ(nif_connect(&options, &handle), NIF_OK) << nif_error_text();
    const OpenNode node(handle);
    if (handle != nullptr) {
      EXPECT_EQ(nif_id(handle), steps[3].header().dst);
      RecordedNode player(steps, handle);
      player.play();
      EXPECT_GT(player.watched(), 5u);
      EXPECT_EQ(player.messages(), 4u);
    }
  }
  playing.join();
}

}  // namespace
}  // namespace gimnet::nif::test
