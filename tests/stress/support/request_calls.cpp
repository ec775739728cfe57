#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <string>

#include "tests/stress/support/api_caller.hpp"

// Calls that receive, ask and answer.

namespace gimnet::stress {
namespace {

gimi_handle source(ApiCaller& c) {
  return c.handle(c.one_of({Kind::subscription, Kind::subscription, Kind::queue, Kind::accepted}));
}

void queue(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const gimi_key key{static_cast<std::uint32_t>(c.below(4)), 0};
  gimi_queue_options options{};
  options.struct_size = sizeof options;
  options.messages = c.one_of<std::size_t>({0, 0, 1, 10});
  options.at_full = static_cast<gimi_at_full_queue>(c.one_in(8) ? 1 : 0);
  const gimi_queue_options* const given = c.one_in(2) ? &options : nullptr;
  gimi_handle made = 0;
  c.keep(c.timed(0, [&] { return gimi_queue(node, key, given, &made); }), made);
}

void receive(ApiCaller& c) {
  const gimi_handle from = c.one_in(4) ? c.handle(Kind::node) : source(c);
  const std::int32_t time = c.timeout();
  gimi_message message{};
  if (c.timed(time, [&] { return gimi_receive(from, time, &message); }) == GIMI_OK) c.take(message);
}

void receive_newest(ApiCaller& c) {
  const gimi_handle from = source(c);
  gimi_message message{};
  if (c.timed(0, [&] { return gimi_receive_newest(from, &message); }) == GIMI_OK) c.take(message);
}

void receive_packed(ApiCaller& c) {
  const gimi_handle from = source(c);
  const std::int32_t time = c.timeout();
  const auto most = static_cast<std::uint32_t>(c.below(100));
  gimi_batch batch{};
  c.timed(time, [&] { return gimi_receive_packed(from, most, time, &batch); });
  for (std::uint32_t i = 0; i < batch.count; ++i) c.look_at(batch.messages[i]);
  gimi_batch_release(&batch);
  gimi_batch_release(&batch);
}

void resize(ApiCaller& c) {
  const gimi_handle from = source(c);
  const auto size = c.one_of<std::size_t>({0, 1, 2, 64, 1u << 25});
  c.timed(0, [&] { return gimi_resize(from, size); });
}

void counts(ApiCaller& c) {
  const gimi_handle from = source(c);
  gimi_queue_counts counts{};
  counts.struct_size = sizeof counts;
  c.timed(0, [&] { return gimi_counts(from, &counts); });
}

/// A request that is in the book.
struct Asked {
  explicit Asked(ApiCaller& c) {
    options.struct_size = sizeof options;
    options.timeout_ms = c.one_of({1, 100, 300, 1000});
    options.lane = static_cast<gimi_lane>(c.below(5));
    options.repeat = c.one_in(4) ? 1 : 0;
    number = c.shared.requests.begin(options.repeat != 0);
    data.assign(sizeof number + (c.one_in(8) ? 20'000 : c.below(20)), 'x');
    std::memcpy(data.data(), &number, sizeof number);
    service =
        c.one_of({"robot/q", "calc/q", "calc/r", "robot/r", "robot/q", "calc/q", "viewer/a", "*"});
  }
  [[nodiscard]] gimi_bytes bytes() const { return {data.data(), data.size()}; }

  gimi_request_options options{};
  std::uint64_t number = 0;
  std::string data;
  const char* service = nullptr;
};

void look_at(const gimi_reply& reply, gimi_status status, std::uint64_t number) {
  EXPECT_EQ(reply.ended, 1u);
  if (status != GIMI_OK) return;
  EXPECT_EQ(reply.ran, GIMI_RAN_YES);
  EXPECT_GE(reply.size, sizeof number);
  if (reply.size < sizeof number) return;
  EXPECT_EQ(std::memcmp(reply.data, &number, sizeof number), 0) << "the reply to another request";
}

void ask(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const Asked asked(c);
  const gimi_bytes bytes = asked.bytes();
  gimi_reply reply{};
  const gimi_status status = c.timed(asked.options.timeout_ms, [&] {
    return gimi_ask(node, asked.service, &bytes, &asked.options, &reply);
  });
  look_at(reply, status, asked.number);
  c.shared.requests.ended(asked.number, status, reply.ran);
  gimi_reply_release(&reply);
  gimi_reply_release(&reply);
}

void ask_later(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const Asked asked(c);
  const gimi_bytes bytes = asked.bytes();
  gimi_handle pending = 0;
  const gimi_status status = c.timed(asked.options.timeout_ms, [&] {
    return gimi_ask_later(node, asked.service, &bytes, &asked.options, &pending);
  });
  if (status == GIMI_OK) {
    c.shared.requests.is_pending(pending, asked.number);
  } else {
    c.shared.requests.ended(asked.number, status, GIMI_RAN_NO);
  }
  c.keep(status, pending);
}

void wait_for_reply(ApiCaller& c) {
  const gimi_handle pending = c.handle(Kind::pending);
  const std::int32_t time = c.timeout();
  gimi_reply reply{};
  const gimi_status status =
      c.timed(time, [&] { return gimi_wait_for_reply(pending, time, &reply); });
  if (reply.ended != 0) {
    look_at(reply, status, c.shared.requests.ended_later(pending, status, reply.ran));
  }
  gimi_reply_release(&reply);
}

void answer(ApiCaller& c) {
  const gimi_handle node = c.handle(Kind::node);
  const std::int32_t time = c.patience();
  const char* const name = c.one_of({"q", "r", "q", "a"});
  gimi_answer_options options{};
  options.struct_size = sizeof options;
  options.timeout_ms = time;
  gimi_handle made = 0;
  c.keep(c.timed(time, [&] { return gimi_answer(node, name, &options, &made); }), made);
}

void next_request(ApiCaller& c) {
  const gimi_handle answers = c.handle(Kind::answers);
  const std::int32_t time = c.timeout();
  gimi_request request{};
  if (c.timed(time, [&] { return gimi_next_request(answers, time, &request); }) == GIMI_OK)
    c.take(request);
}

void in_callback(ApiCaller& c) {
  const std::int32_t before = gimi_in_callback(1);
  ask(c);
  static_cast<void>(gimi_in_callback(before));
}

}  // namespace

std::span<const ApiCall> receive_calls() {
  static constexpr std::array kCalls{
      ApiCall{"queue", queue},
      ApiCall{"receive", receive, 30},
      ApiCall{"receive_newest", receive_newest, 8},
      ApiCall{"receive_packed", receive_packed, 12},
      ApiCall{"resize", resize, 2},
      ApiCall{"counts", counts},
  };
  return kCalls;
}

std::span<const ApiCall> request_calls() {
  static constexpr std::array kCalls{
      ApiCall{"ask", ask, 12},
      ApiCall{"ask_later", ask_later, 12},
      ApiCall{"wait_for_reply", wait_for_reply, 16},
      ApiCall{"answer", answer, 12},
      ApiCall{"next_request", next_request, 48},
      ApiCall{"ask in a callback", in_callback, 1},
  };
  return kCalls;
}

}  // namespace gimnet::stress
