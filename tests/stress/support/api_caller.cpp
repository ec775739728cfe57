#include "tests/stress/support/api_caller.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <utility>

namespace gimnet::stress {
namespace {

/// The end of what a handle stands for may ask the hub, a second at most, in the thread that leaves
/// it last. A node's end writes what waits before, for another second.
constexpr std::int32_t kEndMs = 2000;
/// Beyond its limit: eight threads, the hub and a sanitizer share few processors.
constexpr std::int64_t kGraceMs = 8000;
constexpr std::size_t kKept = 16;

const std::vector<ApiCall>& all_calls() {
  static const std::vector<ApiCall> calls = [] {
    std::vector<ApiCall> all;
    for (const auto part : {node_calls(), hub_calls(), service_calls(), receive_calls(),
                            request_calls(), session_calls()})
      all.insert(all.end(), part.begin(), part.end());
    return all;
  }();
  return calls;
}

std::uint8_t filling(std::size_t size) { return static_cast<std::uint8_t>(size * 31 + 7); }

}  // namespace

void ApiCaller::call_one() {
  static const std::vector<std::size_t> drawn = [] {
    std::vector<std::size_t> numbers;
    for (std::size_t i = 0; i < all_calls().size(); ++i)
      numbers.insert(numbers.end(), all_calls()[i].weight, i);
    return numbers;
  }();
  const ApiCall& call = all_calls()[drawn[below(drawn.size())]];
  name_ = call.name;
  picked_ = 0;
  call.call(*this);
}

void ApiCaller::call_all_in_child() {
  is_child_ = true;
  for (int round = 0; round < 3; ++round) {
    for (const ApiCall& call : all_calls()) {
      if (!call.takes_handle) continue;
      name_ = call.name;
      call.call(*this);
    }
  }
  for (gimi_request& request : requests_) {
    if (request.storage == nullptr) continue;
    EXPECT_EQ(gimi_reply_to(&request, nullptr, 0, 0), GIMI_FORKED);
    EXPECT_EQ(gimi_fail_request(&request, 1, nullptr), GIMI_FORKED);
  }
  release_all();
  for (std::size_t kind = kKinds; kind > 0; --kind) {
    for (const gimi_handle handle : shared.handles.take_all(static_cast<Kind>(kind))) {
      const gimi_status status = gimi_close(handle);
      EXPECT_TRUE(status == GIMI_OK || status == GIMI_CLOSED) << gimi_status_text(status);
      EXPECT_EQ(gimi_close(handle), GIMI_CLOSED);
    }
  }
}

void ApiCaller::release_all() {
  for (gimi_message& message : messages_) gimi_message_release(&message);
  for (gimi_request& request : requests_) gimi_request_release(&request);
  messages_.clear();
  requests_.clear();
}

std::string ApiCaller::worst() const { return worst_; }

gimi_handle ApiCaller::handle(Kind kind) {
  // A child judges the answers of the parent's handles.
  const std::uint64_t chance = is_child_ ? 99 : below(100);
  if (chance < 2) return random();
  if (chance < 6) return shared.handles.pick_closed(random);
  if (chance < 12) kind = static_cast<Kind>(1 + below(kKinds));
  picked_ = shared.handles.pick(kind, random);
  return picked_;
}

gimi_bytes ApiCaller::data() {
  const auto size = one_of<std::size_t>({0, 1, 16, 16, 100, 1000, 5000, 10'000, 100'000});
  data_.assign(one_in(50) ? 1u << 20 : size, 0);
  std::fill(data_.begin(), data_.end(), filling(data_.size()));
  return {data_.data(), data_.size()};
}

gimi_status ApiCaller::judge(std::int32_t limit_ms, gimi_status status) {
  judge_time(limit_ms);
  if (is_child_) {
    // Some look at their arguments first.
    EXPECT_TRUE(status == GIMI_FORKED || status == GIMI_CLOSED || status == GIMI_BAD_ARGUMENT)
        << name_ << " in a child: " << gimi_status_text(status);
    return status;
  }
  if (status == GIMI_OK) {
    note_success();
    return status;
  }
  EXPECT_NE(*gimi_error_text(), '\0') << name_;
  EXPECT_NE(status, GIMI_FORKED) << name_ << ": " << gimi_error_text();
  EXPECT_NE(status, GIMI_PROTOCOL) << name_ << ": " << gimi_error_text();
  // One that has ended is soon not picked any more: little is left to find out with it.
  const bool ended = status == GIMI_CLOSED || status == GIMI_REFUSED;
  if (ended && one_in(3) && shared.handles.drop(picked_)) close(picked_);
  return status;
}

void ApiCaller::judge_number(std::uint64_t answer) {
  judge_time(0);
  if (is_child_) {
    EXPECT_EQ(answer, 0u) << name_ << " in a child";
  }
  if (answer != 0) note_success();
}

void ApiCaller::note_success() {
  if (noted_.insert(name_).second) shared.successes.succeeded(name_);
}

void ApiCaller::judge_time(std::int32_t limit_ms) {
  ++calls_;
  const std::int64_t took =
      std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - begun_).count();
  const std::int64_t late = took - limit_ms;
  EXPECT_LE(late, kEndMs + kGraceMs) << name_ << " took " << took << " ms";
  if (late <= worst_ms_) return;
  worst_ms_ = late;
  worst_ = std::string(name_) + " took " + std::to_string(took) + " ms, its limit is " +
           std::to_string(limit_ms);
}

void ApiCaller::keep(gimi_status status, const gimi_handle& made) {
  EXPECT_EQ(status == GIMI_OK, made != 0) << name_;
  if (made == 0) return;
  const gimi_handle gone = shared.handles.put(made, random);
  if (gone != 0) close(gone);
}

void ApiCaller::close(gimi_handle handle) {
  shared.requests.closed(handle);
  begin();
  const gimi_status status = gimi_close(handle);
  judge_time(0);
  EXPECT_TRUE(status == GIMI_OK || status == GIMI_CLOSED) << gimi_status_text(status);
}

void ApiCaller::look_at(const gimi_message& message) const {
  EXPECT_NE(message.service, nullptr);
  if (message.service == nullptr) return;
  static_cast<void>(std::strlen(message.service));
  const auto* bytes = static_cast<const std::uint8_t*>(message.data);
  EXPECT_TRUE(std::all_of(bytes, bytes + message.size,
                          [&](std::uint8_t byte) { return byte == filling(message.size); }))
      << "a message of " << message.size << " bytes of '" << message.service << "' has others";
  if (message.size > 8192) {
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(message.data) % 64, 0u);
  }
  std::int64_t age = 0;
  std::int64_t error = 0;
  static_cast<void>(gimi_message_age(&message, &age, &error));
}

void ApiCaller::take(gimi_message& message) {
  look_at(message);
  if (one_in(2)) return gimi_message_release(&message);
  messages_.push_back(std::exchange(message, {}));
  if (messages_.size() <= kKept) return;
  std::swap(messages_[below(messages_.size())], messages_.back());
  look_at(messages_.back());
  gimi_message_release(&messages_.back());
  gimi_message_release(&messages_.back());
  messages_.pop_back();
}

void ApiCaller::take(gimi_request& request) {
  std::uint64_t number = 0;
  EXPECT_GE(request.size, sizeof number);
  if (request.size < sizeof number) return gimi_request_release(&request);
  std::memcpy(&number, request.data, sizeof number);
  shared.requests.taken(number);
  requests_.push_back(std::exchange(request, {}));
  if (!one_in(2) && requests_.size() <= below(kKept)) return;
  std::swap(requests_[below(requests_.size())], requests_.back());
  finish(requests_.back());
  requests_.pop_back();
}

void ApiCaller::finish(gimi_request& request) {
  const auto reply = [&] {
    return gimi_reply_to(&request, request.data, request.size, one_of<std::int32_t>({0, 5, 100}));
  };
  const std::uint64_t deed = below(8);
  if (deed < 4 && timed(100, reply) == GIMI_OK && one_in(2)) {
    EXPECT_NE(timed(100, reply), GIMI_OK) << "answered twice";
  }
  if (deed == 4 || deed == 5) {
    static_cast<void>(timed(1000, [&] { return gimi_fail_request(&request, 7, "no"); }));
  }
  gimi_request_release(&request);
  gimi_request_release(&request);
}

}  // namespace gimnet::stress
