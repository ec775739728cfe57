#include <array>
#include <cstddef>
#include <cstring>
#include <limits>
#include <vector>

#include "tests/stress/support/api_caller.hpp"

// Calls that provide and send.

namespace gimnet::stress {
namespace {

gimi_key key(ApiCaller& c) { return {static_cast<std::uint32_t>(c.below(4)), 0}; }
gimi_lane lane(ApiCaller& c) { return static_cast<gimi_lane>(c.below(c.one_in(8) ? 6 : 5)); }

void advertise(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  const char* const name = c.one_of({"a", "b", "a", "b", "c", "", "a/b"});
  gimi_publish_options options{};
  options.struct_size = sizeof options;
  options.key = key(c);
  options.lane = lane(c);
  options.delivery = static_cast<gimi_delivery>(c.below(3));
  options.window = c.one_of<std::uint32_t>({0, 0, 1, 3, 3, 10, 5000});
  options.retain = c.one_in(3) ? 1 : 0;
  options.no_timestamp = c.one_in(3) ? 1 : 0;
  options.metadata = "made by chance";
  options.timeout_ms = time;
  options.age_ms_max = c.one_of<std::uint32_t>({0, 0, 10, 1000});
  gimi_handle made = 0;
  c.keep(c.timed(time, [&] { return gimi_advertise(node, name, &options, &made); }), made);
}

void publish(ApiCaller& c) {
  const gimi_handle publisher = c.handle(Kind::publisher);
  const std::int32_t time = c.timeout();
  const std::int32_t more = c.one_in(4) ? 1 : 0;
  const gimi_bytes bytes = c.data();
  c.timed(time, [&] { return gimi_publish(publisher, bytes.data, bytes.size, time, more); });
}

void publish_many(ApiCaller& c) {
  const gimi_handle publisher = c.handle(Kind::publisher);
  const std::int32_t time = c.timeout();
  const std::vector<gimi_bytes> messages(c.below(20), c.data());
  std::size_t published = 0;
  c.timed(time * static_cast<std::int32_t>(messages.size()), [&] {
    return gimi_publish_many(publisher, messages.data(), messages.size(), time, &published);
  });
}

void publish_loan(ApiCaller& c) {
  const gimi_handle publisher = c.handle(Kind::publisher);
  const std::int32_t time = c.timeout();
  const gimi_bytes bytes = c.data();
  gimi_loaned loan{};
  const auto size = bytes.size + c.below(100);
  if (c.timed(0, [&] { return gimi_loan(publisher, size, &loan); }) != GIMI_OK) return;
  if (bytes.size != 0) std::memcpy(loan.data, bytes.data, bytes.size);
  loan.size = bytes.size;
  // It may be another publisher's.
  const gimi_handle other = c.handle(Kind::publisher);
  if (!c.one_in(4)) c.timed(time, [&] { return gimi_publish_loan(other, &loan, time, 0); });
  gimi_loan_release(&loan);
  gimi_loan_release(&loan);
}

void subscribers(ApiCaller& c) {
  const gimi_handle publisher = c.handle(Kind::publisher);
  c.number([&] { return gimi_subscribers(publisher); });
  c.number([&] { return gimi_published(publisher); });
  c.number([&] { return gimi_unsent(publisher); });
}

void wait_for_subscribers(ApiCaller& c) {
  const gimi_handle publisher = c.handle(Kind::publisher);
  const std::int32_t time = c.timeout();
  c.timed(time, [&] { return gimi_wait_for_subscribers(publisher, 1 + c.below(3), time); });
}

void subscribers_changed(ApiCaller& c) {
  const gimi_handle publisher = c.handle(Kind::publisher);
  const std::int32_t time = c.timeout();
  std::size_t count = 0;
  c.timed(time, [&] { return gimi_subscribers_changed(publisher, time, &count); });
}

void retained(ApiCaller& c) {
  const gimi_handle publisher = c.handle(Kind::publisher);
  c.timed(0, [&] { return gimi_retained(publisher); });
}

gimi_handle standing_handle(ApiCaller& c) {
  return c.handle(c.one_of({Kind::publisher, Kind::subscription, Kind::accepted, Kind::sender}));
}

void standing(ApiCaller& c) {
  const gimi_handle handle = standing_handle(c);
  c.timed(0, [&] { return gimi_standing(handle); });
}

void service_name(ApiCaller& c) {
  const gimi_handle handle = standing_handle(c);
  std::array<char, 40> name{};
  c.timed(0, [&] { return gimi_service_name(handle, name.data(), name.size()); });
}

void subscribe(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  const char* const name =
      c.one_of({"robot/a", "robot/b", "calc/a", "robot/c", "viewer/a", "a/b/c", "robot", "*"});
  gimi_subscribe_options options{};
  options.struct_size = sizeof options;
  const double not_a_number = std::numeric_limits<double>::quiet_NaN();
  options.rate_hz = c.one_of({0.0, 0.0, 0.0, 0.0, 0.0, 50.0, 100.0, 1000.0, not_a_number, -1.0});
  options.newest_only = c.one_in(4) ? 1 : 0;
  options.queue = c.one_of<std::size_t>({0, 0, 1, 3, 1000});
  options.at_full = static_cast<gimi_at_full_queue>(c.one_in(6) ? 1 : 0);
  options.timeout_ms = time;
  options.silence_ms = c.one_of({0, 0, 10, 1000});
  options.window = c.one_of<std::uint32_t>({0, 0, 0, 1, 10});
  options.depth = c.one_of<std::uint32_t>({0, 0, 1, 8});
  gimi_handle made = 0;
  c.keep(c.timed(time, [&] { return gimi_subscribe(node, name, &options, &made); }), made);
}

void provider(ApiCaller& c) {
  const gimi_handle subscription = c.handle(Kind::subscription);
  gimi_direction direction = 0;
  c.timed(0, [&] { return gimi_provider(subscription, &direction); });
}

void wait_until_exists(ApiCaller& c) {
  const gimi_handle subscription = c.handle(Kind::subscription);
  const std::int32_t time = c.timeout();
  c.timed(time, [&] { return gimi_wait_until_exists(subscription, time); });
}

void accept(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  const char* const name = c.one_of({"s", "t", "s", "a"});
  gimi_accept_options options{};
  options.struct_size = sizeof options;
  options.key = key(c);
  options.messages = c.one_of<std::size_t>({0, 0, 1, 10});
  options.at_full = static_cast<gimi_at_full_queue>(c.one_in(6) ? 1 : 0);
  options.timeout_ms = time;
  gimi_handle made = 0;
  c.keep(c.timed(time, [&] { return gimi_accept(node, name, &options, &made); }), made);
}

gimi_send_options send_options(ApiCaller& c) {
  gimi_send_options options{};
  options.struct_size = sizeof options;
  options.key = key(c);
  // The options of the first sender hold for all: mostly the same.
  options.window = options.key.type;
  options.at_full = static_cast<gimi_at_full_window>(options.key.type % 3);
  options.lane = c.one_in(8) ? lane(c) : 0;
  options.end_at_loss = c.one_in(16) ? 1 : 0;
  options.timestamp = 1;
  return options;
}

void sender_to_service(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  const char* const name =
      c.one_of({"robot/s", "calc/s", "robot/t", "viewer/s", "robot/a", "robot", "*"});
  const gimi_send_options options = send_options(c);
  gimi_handle made = 0;
  c.keep(c.timed(time, [&] { return gimi_sender_to_service(node, name, &options, time, &made); }),
         made);
}

void sender(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const gimi_peer to = gimi_id(c.handle(Kind::node));
  const gimi_send_options options = send_options(c);
  gimi_handle made = 0;
  c.keep(c.timed(0, [&] { return gimi_sender(node, to, &options, &made); }), made);
}

void send(ApiCaller& c) {
  const gimi_handle stream = c.handle(Kind::sender);
  const std::int32_t time = c.timeout();
  const gimi_bytes bytes = c.data();
  c.timed(time, [&] { return gimi_send(stream, bytes.data, bytes.size, time, 0); });
}

void settle(ApiCaller& c) {
  const gimi_handle stream = c.handle(Kind::sender);
  const std::int32_t time = c.timeout();
  c.timed(time, [&] { return gimi_settle(stream, time); });
}

void sent(ApiCaller& c) {
  const gimi_handle stream = c.handle(Kind::sender);
  gimi_send_counts counts{};
  counts.struct_size = sizeof counts;
  c.timed(0, [&] { return gimi_sent(stream, &counts); });
  c.number([&] { return gimi_sends_to(stream); });
}

void send_to(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const gimi_peer to = gimi_id(c.handle(Kind::node));
  const std::int32_t time = c.timeout();
  const gimi_bytes bytes = c.data();
  const gimi_send_options options = send_options(c);
  c.timed(time, [&] { return gimi_send_to(node, to, &bytes, &options, time); });
}

}  // namespace

std::span<const ApiCall> service_calls() {
  static constexpr std::array kCalls{
      ApiCall{"advertise", advertise, 12},
      ApiCall{"publish", publish, 24},
      ApiCall{"publish_many", publish_many, 8},
      ApiCall{"publish_loan", publish_loan, 8},
      ApiCall{"subscribers", subscribers},
      ApiCall{"wait_for_subscribers", wait_for_subscribers},
      ApiCall{"subscribers_changed", subscribers_changed},
      ApiCall{"retained", retained},
      ApiCall{"standing", standing},
      ApiCall{"service_name", service_name},
      ApiCall{"subscribe", subscribe, 12},
      ApiCall{"provider", provider},
      ApiCall{"wait_until_exists", wait_until_exists},
      ApiCall{"accept", accept, 8},
      ApiCall{"sender_to_service", sender_to_service, 8},
      ApiCall{"sender", sender},
      ApiCall{"send", send, 16},
      ApiCall{"settle", settle},
      ApiCall{"sent", sent},
      ApiCall{"send_to", send_to, 8},
  };
  return kCalls;
}

}  // namespace gimnet::stress
