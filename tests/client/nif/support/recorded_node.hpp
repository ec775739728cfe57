#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "gimnet/nif.h"
#include "proto/control/ns.hpp"
#include "proto/control/ns_watch.hpp"
#include "proto/frame/extensions.hpp"
#include "proto/frame/report.hpp"
#include "tests/client/nif/support/fake_hub.hpp"
#include "tests/client/nif/support/recorded_hub.hpp"
#include "tests/client/nif/support/recording.hpp"

namespace gimnet::nif::test {

/// Does what a recorded node did, by the calls of the library, and expects to be told what it was
/// told.
class RecordedNode {
 public:
  RecordedNode(const std::vector<Connection>& connections, nif_node* node, RecordedHub& hub)
      : connections_(connections), node_(node), hub_(hub) {}

  void play() {
    for (std::size_t i = 0; i < connections_.size(); ++i) {
      SCOPED_TRACE("the node, connection " + std::to_string(i));
      be_welcome(connections_[i][1], i > 0);
      play(connections_[i]);
      if (::testing::Test::HasFatalFailure()) return;
    }
  }
  /// Counts of what the recording had for it.
  [[nodiscard]] std::size_t messages() const { return messages_; }
  [[nodiscard]] std::size_t events() const { return events_; }
  [[nodiscard]] std::size_t answers() const { return answers_; }

 private:
  void be_welcome(const Step& step, bool back) {
    const proto::Welcome welcome = proto::decode<proto::Welcome>(step.view().payload).value();
    if (back) {
      expect(NIF_CONNECTED, [&](const nif_incoming& in) {
        EXPECT_EQ(in.from, welcome.node.value());
        EXPECT_EQ((in.flags & NIF_CONNECTED_RESUMED) != 0, welcome.resumed);
      });
    }
    EXPECT_EQ(nif_id(node_), welcome.node.value());
    const nif_info info = info_of(node_);
    EXPECT_EQ(info.name, welcome.name);
    EXPECT_EQ(info.hub_name, welcome.hub_name);
    EXPECT_EQ(info.hub_id, welcome.hub.value());
    EXPECT_EQ(info.resume, welcome.resume_buffer_bytes > 0 ? 1 : 0);
    hub_.let_go_on();
  }
  void play(const Connection& steps) {
    for (std::size_t i = 2; i < steps.size() && !::testing::Test::HasFatalFailure(); ++i) {
      const Step& step = steps[i];
      SCOPED_TRACE("step " + std::to_string(i));
      if (step.is_break()) {
        expect(NIF_DISCONNECTED, [](const nif_incoming& in) { EXPECT_EQ(in.reason, 0u); });
      } else if (step.is_of_the_library() || step.is_answer()) {
        continue;
      } else if (step.from_hub) {
        be_told(step);
      } else if (step.is_request_kind()) {
        ask(step, answer_to(step, steps));
        ++answers_;
      } else if (!step.is(proto::Kind::link)) {
        send(step);
      }
    }
  }

  // Its requests

  static const Step& answer_to(const Step& question, const Connection& steps) {
    for (const Step& step : steps) {
      if (step.is_answer() && step.control().header.request == question.control().header.request)
        return step;
    }
    throw std::runtime_error("a request without an answer");
  }
  void ask(const Step& step, const Step& answer) {
    const auto payload = step.view().payload;
    if (step.is_about<proto::ns::Watch>()) {
      std::uint32_t watch = 0;
      ASSERT_EQ(nif_watch(node_, nullptr, NIF_WATCH_ALL, &watch, kPatienceMs), NIF_OK);
      EXPECT_EQ(watch, proto::decode<proto::ns::Watch>(payload)->watch);
    } else if (step.is_about<proto::ns::Unwatch>()) {
      EXPECT_EQ(nif_unwatch(node_, proto::decode<proto::ns::Unwatch>(payload)->watch, kPatienceMs),
                NIF_OK);
    } else if (step.is_about<proto::ns::Subscribe>()) {
      subscribe(*proto::decode<proto::ns::Subscribe>(payload), answer);
    } else if (step.is_about<proto::ns::Unsubscribe>()) {
      const auto name = proto::decode<proto::ns::Unsubscribe>(payload)->name;
      EXPECT_EQ(nif_unsubscribe(node_, name.c_str(), kPatienceMs), NIF_OK);
    } else if (step.is_about<proto::ns::Advertise>()) {
      advertise(*proto::decode<proto::ns::Advertise>(payload), answer);
    } else if (step.is_about<proto::ns::Withdraw>()) {
      EXPECT_EQ(nif_withdraw(node_, proto::decode<proto::ns::Withdraw>(payload)->group.value(),
                             kPatienceMs),
                NIF_OK);
    } else {
      request(step, answer);
    }
  }
  void subscribe(const proto::ns::Subscribe& wanted, const Step& answer) {
    const auto said = proto::decode_answer<proto::ns::SubscribeAnswer>(answer.view().payload);
    ASSERT_TRUE(said);
    nif_subscription subscription{};
    nif_pace pace{};
    pace.struct_size = sizeof pace;
    pace.window = wanted.window;
    pace.depth = wanted.depth;
    ASSERT_EQ(nif_subscribe_paced(node_, wanted.name.c_str(), &pace, &subscription, kPatienceMs),
              NIF_OK);
    EXPECT_EQ(subscription.group, said->group.value());
    EXPECT_EQ(subscription.provider, said->provider.value());
    EXPECT_EQ(subscription.session, said->session);
    EXPECT_EQ(subscription.message_type, said->message_type);
    EXPECT_EQ(subscription.window, said->window);
    EXPECT_EQ(subscription.retain != 0, said->retain);
  }
  void advertise(const proto::ns::Advertise& wanted, const Step& answer) {
    const auto said = proto::decode_answer<proto::ns::AdvertiseAnswer>(answer.view().payload);
    ASSERT_TRUE(said);
    nif_service service{};
    service.struct_size = sizeof service;
    service.name = wanted.service.c_str();
    service.message_type = wanted.message_type;
    service.instance = wanted.instance;
    service.direction = static_cast<std::uint8_t>(wanted.direction);
    service.delivery = static_cast<std::uint8_t>(wanted.delivery);
    service.metadata = wanted.metadata.c_str();
    service.window = wanted.window;
    service.retain = wanted.retain ? 1 : 0;
    std::uint32_t group = 0;
    std::uint32_t subscribers = 99;
    ASSERT_EQ(nif_advertise(node_, &service, &group, &subscribers, kPatienceMs), NIF_OK);
    EXPECT_EQ(group, said->group.value());
    EXPECT_EQ(subscribers, said->subscribers);
  }
  void request(const Step& step, const Step& answer) {
    nif_reply* reply = nullptr;
    const auto body = step.control().body;
    ASSERT_EQ(nif_request(node_, static_cast<std::uint8_t>(step.header().kind), step.operation(),
                          body.data(), body.size(), &reply, kPatienceMs),
              NIF_OK);
    EXPECT_EQ(reply->status, static_cast<std::uint16_t>(proto::peek_status(answer.view().payload)));
    const auto* content = static_cast<const std::byte*>(reply->content);
    EXPECT_EQ(Bytes(content, content + reply->size), gimnet::test::to_bytes(answer.control().body));
    nif_free_reply(reply);
  }

  // Its messages

  void send(const Step& step) {
    const proto::FrameView view = step.view();
    const auto whole = sent_.add(view);
    if (!whole) return;
    nif_outgoing out = NIF_OUTGOING_INIT;
    out.kind = static_cast<std::uint8_t>(view.header.kind);
    out.lane = view.header.lane;
    out.policy = static_cast<std::uint8_t>(view.header.policy());
    out.to = view.header.dst;
    if (view.header.has(proto::kFlagReport)) out.flags |= NIF_FLAG_REPORT;
    if (view.key) out.flags |= NIF_FLAG_KEYED;
    out.key = view.key.value_or(0);
    std::vector<std::uint32_t> recipients;
    for (std::uint32_t i = 0; i < view.recipients.size(); ++i)
      recipients.push_back(view.recipients[i].value());
    out.recipients = recipients.data();
    out.recipient_count = recipients.size();
    if (const auto age = proto::find_age(view.extensions)) out.age_ms_max = age->longest_ms;
    if (const auto trace = proto::find_trace(view.extensions))
      out.trace_slots = static_cast<std::uint8_t>(trace->slots());
    const nif_bytes part{whole->data(), whole->size()};
    out.parts = &part;
    out.part_count = 1;
    EXPECT_EQ(nif_send(node_, &out, kPatienceMs), NIF_OK);
  }

  // Words to it

  void be_told(const Step& step) {
    switch (step.header().kind) {
      case proto::Kind::link:
        return expect(NIF_DISCONNECTED, [&](const nif_incoming& in) {
          EXPECT_EQ(in.reason, static_cast<std::uint32_t>(
                                   proto::decode<proto::Goodbye>(step.view().payload)->code));
        });
      case proto::Kind::flow:
        return be_told_flow(*proto::flow::decode(step.view().payload));
      case proto::Kind::taken:
        return;  // of parts that the library did not cut
      case proto::Kind::report:
        return be_told_report(step);
      case proto::Kind::ns:
        return be_told_event(step);
      default:
        return be_told_message(step);
    }
  }
  void be_told_message(const Step& step) {
    const proto::FrameView view = step.view();
    const auto whole = told_.add(view);
    if (!whole) return;
    ++messages_;
    expect(NIF_MESSAGE, [&](const nif_incoming& in) {
      EXPECT_EQ(in.kind, static_cast<std::uint8_t>(view.header.kind));
      EXPECT_EQ(in.from, view.header.src);
      EXPECT_EQ(in.to, view.header.dst);
      EXPECT_EQ(in.lane, view.header.lane);
      EXPECT_EQ(in.policy, static_cast<std::uint8_t>(view.header.policy()));
      EXPECT_EQ(in.key, view.key.value_or(0));
      EXPECT_EQ(payload_of(in),
                std::string_view(reinterpret_cast<const char*>(whole->data()), whole->size()));
      const auto* extensions = static_cast<const std::byte*>(in.extensions);
      EXPECT_EQ(Bytes(extensions, extensions + in.extensions_size),
                gimnet::test::to_bytes(view.extensions));
    });
  }
  void be_told_report(const Step& step) {
    const auto report = proto::decode_report(step.view().payload);
    ASSERT_TRUE(report);
    ++events_;
    expect(NIF_REPORT, [&](const nif_incoming& in) {
      EXPECT_EQ(in.from, step.header().src);
      EXPECT_EQ(in.reason, static_cast<std::uint32_t>(report->reason));
      EXPECT_EQ(in.count, report->count);
      EXPECT_EQ(in.to, report->header.dst);
    });
  }
  void be_told_flow(const proto::flow::Message& message) {
    ++events_;
    if (const auto* skip = std::get_if<proto::flow::Skip>(&message)) {
      expect(NIF_GAP, [&](const nif_incoming& in) {
        EXPECT_EQ(in.reason, static_cast<std::uint32_t>(skip->reason));
        EXPECT_EQ(in.count, skip->count);
      });
    } else if (std::holds_alternative<proto::flow::Pause>(message)) {
      ++pauses_;
      const auto end = std::chrono::steady_clock::now() + kPatience;
      while (counters_of(node_).pauses < pauses_ && std::chrono::steady_clock::now() < end)
        std::this_thread::yield();
      EXPECT_EQ(counters_of(node_).pauses, pauses_);
    } else if (const auto* resume = std::get_if<proto::flow::Resume>(&message)) {
      send_again_to(resume->target);
    }
  }
  /// Sends what had to wait.
  void send_again_to(const proto::flow::Target& target) {
    const std::string text = "it goes on";
    const nif_bytes part{text.data(), text.size()};
    nif_outgoing out = NIF_OUTGOING_INIT;
    out.kind = static_cast<std::uint8_t>(target.kind);
    out.lane = static_cast<std::uint8_t>(target.lane);
    out.to = target.dst;
    out.parts = &part;
    out.part_count = 1;
    EXPECT_EQ(nif_send(node_, &out, kPatienceMs), NIF_OK);
  }
  void be_told_event(const Step& step) {
    const auto payload = step.view().payload;
    if (step.is_about<proto::ns::WatchEvents>())
      return be_told_changes(*proto::decode<proto::ns::WatchEvents>(payload));
    ++events_;
    if (step.is_about<proto::ns::Subscribers>()) {
      const auto event = proto::decode<proto::ns::Subscribers>(payload);
      return expect(NIF_SUBSCRIBERS, [&](const nif_incoming& in) {
        EXPECT_EQ(in.group, event->group.value());
        EXPECT_EQ(in.count, event->subscribers);
      });
    }
    ASSERT_TRUE(step.is_about<proto::ns::ServiceMoved>());
    const auto event = proto::decode<proto::ns::ServiceMoved>(payload);
    expect(NIF_SERVICE_MOVED, [&](const nif_incoming& in) {
      EXPECT_EQ(in.text, event->name);
      EXPECT_EQ(in.group, event->group.value());
      EXPECT_EQ(in.from, event->provider.value());
      EXPECT_EQ(in.count, event->session);
    });
  }
  void be_told_changes(const proto::ns::WatchEvents& events) {
    for (const proto::ns::Change& change : events.changes) {
      ++events_;
      expect(NIF_WATCHED, [&](const nif_incoming& in) {
        EXPECT_EQ(in.watched->change, static_cast<std::uint32_t>(change.kind));
        EXPECT_EQ(in.watched->version, change.version);
        EXPECT_EQ(in.watched->node != nullptr, change.node.has_value());
        EXPECT_EQ(in.watched->service != nullptr, change.service.has_value());
        if (in.watched->node != nullptr && change.node) {
          EXPECT_EQ(in.watched->node->name, change.node->name);
        }
        if (in.watched->service != nullptr && change.service) {
          EXPECT_EQ(in.watched->service->name, change.service->name);
        }
      });
    }
  }
  template <class Check>
  void expect(nif_incoming_type type, Check check) {
    nif_incoming in{};
    ASSERT_EQ(nif_receive(node_, &in, kPatienceMs), NIF_OK);
    EXPECT_EQ(in.type, static_cast<std::uint32_t>(type)) << in.text;
    if (in.type == static_cast<std::uint32_t>(type)) check(in);
    nif_release(&in);
  }

  static constexpr std::int32_t kPatienceMs = 20'000;

  const std::vector<Connection>& connections_;
  nif_node* const node_;
  RecordedHub& hub_;
  std::size_t messages_ = 0;
  std::size_t events_ = 0;
  std::size_t answers_ = 0;
  std::uint64_t pauses_ = 0;
  Parts told_;
  Parts sent_;
};

}  // namespace gimnet::nif::test
