#include "generator/gimnet_wire.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "base/clock.hpp"
#include "net/socket.hpp"
#include "proto/control/control_message.hpp"
#include "proto/control/ctrl.hpp"
#include "proto/control/link.hpp"
#include "proto/control/names.hpp"
#include "proto/control/ns.hpp"
#include "proto/frame/flow.hpp"

namespace gimnet::perf {
namespace {

constexpr const char* kPublisherName = "publisher";
constexpr const char* kServiceName = "data";
constexpr std::uint16_t kRequestNumber = 1;

/// A frame of FLOW is written at once.
template <class Message>
void send_flow(Client& client, const Message& message, std::uint32_t from) {
  std::array<std::byte, proto::flow::kFrameSizeMax> frame{};
  const std::size_t size = proto::flow::encode_frame(message, NodeId{from}, frame);
  client.write_control(std::span<const std::byte>(frame).first(size));
}

/// The message, or the end of the program.
template <class Message>
Message decoded(std::span<const std::byte> body) {
  auto message = proto::decode<Message>(body);
  if (!message) fail("the hub sent what cannot be read: " + message.error().sentence);
  return std::move(*message);
}

template <class Answer>
Answer granted(std::span<const std::byte> body) {
  auto answer = proto::decode_answer<Answer>(body);
  if (!answer) fail("the hub refused a request: " + answer.error().sentence);
  return std::move(*answer);
}

}  // namespace

void GimnetWire::open(Client& client) {
  if (client.index() >= sessions_.size()) sessions_.resize(client.index() + 1);
  proto::Hello hello;
  if (client.index() == 0) hello.name = kPublisherName;
  std::vector<std::byte> bytes(proto::kOpening.begin(), proto::kOpening.end());
  append_frame({.kind = proto::Kind::link}, proto::encode(hello), bytes);
  client.write_control(bytes);
}

void GimnetWire::request(Client& client, proto::Kind kind, std::span<const std::byte> payload) {
  std::vector<std::byte> frame;
  append_frame({.src = node_id(client), .kind = kind}, payload, frame);
  client.write_control(frame);
}

void GimnetWire::provide(Client& client) {
  proto::ns::Advertise advertise;
  advertise.service = kServiceName;
  request(client, proto::Kind::ns, proto::encode(advertise, kRequestNumber));
}

void GimnetWire::subscribe(Client& client) {
  proto::ns::Subscribe subscribe;
  subscribe.name = proto::join_service_name(kPublisherName, kServiceName);
  request(client, proto::Kind::ns, proto::encode(subscribe, kRequestNumber));
}

std::size_t GimnetWire::take(Client& client, std::span<const std::byte> bytes) {
  Session& session = sessions_[client.index()];
  if (session.is_opened) return Wire::take(client, bytes);
  switch (proto::check_opening(bytes)) {
    case proto::Opening::need_more:
      return 0;
    case proto::Opening::accepted:
      break;
    default:
      fail("the subject is not a GIMnet hub of this version");
  }
  session.is_opened = true;
  return proto::kOpeningSize + Wire::take(client, bytes.subspan(proto::kOpeningSize));
}

void GimnetWire::take_other(Client& client, const proto::FrameHeader& header,
                            std::span<const std::byte> body) {
  switch (header.kind) {
    case proto::Kind::link:
      return take_link(client, body);
    case proto::Kind::ns:
      return take_answer(client, body);
    case proto::Kind::ctrl:
      return take_statistics(body);
    case proto::Kind::flow:
      return take_flow(client, body);
    case proto::Kind::report:
      return;  // the gap in the sequence tells what was lost
    default:
      client.inbox.on_wrong();
  }
}

void GimnetWire::take_link(Client& client, std::span<const std::byte> body) {
  const auto view = proto::split_control(body);
  if (view && view->header.operation == proto::Goodbye::kOperation) {
    const auto goodbye = decoded<proto::Goodbye>(body);
    fail("the hub said goodbye to client " + std::to_string(client.index()) + ", " +
         proto::goodbye_name(goodbye.code) + ": " + goodbye.sentence);
  }
  if (client.is_joined) return client.inbox.on_wrong();
  sessions_[client.index()].node_id = decoded<proto::Welcome>(body).node.value();
  admit(client);
}

void GimnetWire::take_answer(Client& client, std::span<const std::byte> body) {
  const auto view = proto::split_control(body);
  if (!view) return client.inbox.on_wrong();
  switch (view->header.operation) {
    case proto::ns::AdvertiseAnswer::kOperation:
      group_id_ = granted<proto::ns::AdvertiseAnswer>(body).group.value();
      client.is_in_group = true;
      return;
    case proto::ns::SubscribeAnswer::kOperation:
      if (granted<proto::ns::SubscribeAnswer>(body).group.value() != group_id_)
        fail("a subscriber got another group");
      client.is_in_group = true;
      return;
    default:
      return;  // events: subscribers come and go
  }
}

bool GimnetWire::ask_for_ledger(Client& client) {
  ledger_.reset();
  request(client, proto::Kind::ctrl, proto::encode(proto::ctrl::Statistics{}, kRequestNumber));
  return true;
}

void GimnetWire::take_statistics(std::span<const std::byte> body) {
  Ledger sum;
  const auto statistics = granted<proto::ctrl::StatisticsAnswer>(body);
  for (const auto& shard : statistics.shards) {
    for (const auto& counter : shard.counters) {
      if (counter.name == "accepted") sum.accepted += counter.value;
      if (counter.name == "copies") sum.copies += counter.value;
      if (counter.name == "delivered") sum.delivered += counter.value;
      if (counter.name == "queued") sum.queued += counter.value;
      if (counter.name.starts_with("dropped.")) sum.dropped += counter.value;
    }
  }
  ledger_ = sum;
}

void GimnetWire::take_flow(Client& client, std::span<const std::byte> body) {
  const auto message = proto::flow::decode(body);
  if (!message) return client.inbox.on_wrong();
  if (const auto* const ping = std::get_if<proto::flow::Ping>(&*message)) {
    send_flow(client,
              proto::flow::Pong{
                  .sequence = ping->sequence, .sent_ns = ping->sent_ns, .now_ns = wall_now_ns()},
              node_id(client));
    ++keep_alives_.asked;
  } else if (std::holds_alternative<proto::flow::Pong>(*message)) {
    ++keep_alives_.answered;
  } else if (const auto* const pause = std::get_if<proto::flow::Pause>(&*message)) {
    if (std::ranges::find(client.paused, pause->target) == client.paused.end())
      client.paused.push_back(pause->target);
  } else if (const auto* const resume = std::get_if<proto::flow::Resume>(&*message)) {
    std::erase(client.paused, resume->target);
  }
}

void GimnetWire::keep_alive(Client& client) {
  ++keep_alives_.said;
  const std::uint32_t number = ++sessions_[client.index()].pings;
  send_flow(client, proto::flow::Ping{.sequence = number, .sent_ns = wall_now_ns()},
            node_id(client));
}

}  // namespace gimnet::perf
