#include "client/nif/request_table.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "base/endian.hpp"
#include "gimnet/nif.h"
#include "proto/frame/frame_builder.hpp"

namespace gimnet::nif {

static_assert(NIF_REQUESTS_MAX == proto::kOpenRequestsMax);
namespace {

std::uint16_t operation_of(const proto::Payload& payload) {
  return load_le<std::uint16_t>(payload.data());
}

std::vector<std::byte> request_frame(proto::Kind kind, const proto::Payload& payload,
                                     std::uint16_t number, HubId hub = kOwnHub) {
  proto::FrameParts parts;
  parts.header.kind = kind;
  parts.header.dst = make_id<NodeId>(hub, kHubIndex).value();
  std::vector<std::byte> frame(proto::kHeaderSize + payload.size());
  static_cast<void>(proto::write_frame(parts, payload, frame));
  store_le(frame.data() + proto::kHeaderSize + 2, number);
  return frame;
}

nif_status timed_out() { return fail(NIF_TIMEOUT, "the hub did not answer within the time given"); }
nif_status closed() { return fail(NIF_CLOSED, "the handle was closed"); }

}  // namespace

/// As the hub counts them: what was answered or broke is none to it, though its caller has not seen
/// that yet.
std::size_t RequestTable::unanswered() const {
  return static_cast<std::size_t>(std::ranges::count_if(open_, [](const auto& entry) {
    return entry.second.state == State::waiting || entry.second.state == State::abandoned;
  }));
}

std::optional<std::uint16_t> RequestTable::reserve(proto::Kind kind, std::uint16_t operation,
                                                   Handler handler) {
  if (unanswered() >= proto::kOpenRequestsMax) return std::nullopt;
  do {
    ++last_number_;
  } while (last_number_ == proto::kNoRequest || open_.contains(last_number_));
  open_.emplace(last_number_, Open{kind, operation, State::waiting, {}, std::move(handler)});
  return last_number_;
}

nif_status RequestTable::wait_for_number(proto::Kind kind, std::uint16_t operation,
                                         Deadline deadline, std::uint16_t& number) {
  for (;;) {
    if (closed_) return closed();
    if (const auto reserved = reserve(kind, operation, {})) {
      number = *reserved;
      return NIF_OK;
    }
    if (deadline != kNever && steady_now_ns() >= deadline) return timed_out();
    static_cast<void>(changed_.wait_until(mutex_, deadline));
  }
}

nif_status RequestTable::wait_for_answer(std::uint16_t number, proto::Payload& answer,
                                         Deadline deadline, bool& again) {
  for (;;) {
    // Only this call removes the entry, so it is there.
    Open& open = open_.find(number)->second;
    if (open.state == State::answered || open.state == State::broken || closed_) {
      again = open.state == State::broken;
      const bool answered = open.state == State::answered;
      if (answered) answer = std::move(open.answer);
      open_.erase(number);
      changed_.notify_all();
      return answered || again ? NIF_OK : closed();
    }
    if (deadline != kNever && steady_now_ns() >= deadline) {
      open.state = State::abandoned;
      return timed_out();
    }
    static_cast<void>(changed_.wait_until(mutex_, deadline));
  }
}

/// `again`: the connection broke before the answer came.
nif_status RequestTable::ask_once(proto::Kind kind, const proto::Payload& payload,
                                  proto::Payload& answer, Deadline deadline, HubId hub,
                                  bool& again) {
  std::uint16_t number = 0;
  // Until it is posted, so that a break comes before both or behind both: what went out behind it
  // would be counted by the next hub, and not here.
  const MutexLock lock(mutex_);
  const nif_status status = wait_for_number(kind, operation_of(payload), deadline, number);
  if (status != NIF_OK) return status;
  const bool posted = outbound_.post(request_frame(kind, payload, number, hub));
  if (posted) return wait_for_answer(number, answer, deadline, again);
  open_.erase(number);
  again = true;
  changed_.notify_all();
  return NIF_OK;
}

nif_status RequestTable::ask(proto::Kind kind, const proto::Payload& payload,
                             proto::Payload& answer, Deadline deadline, HubId hub) {
  for (;;) {
    nif_status status = outbound_.wait_connected(deadline);
    if (status != NIF_OK) return status;
    bool again = false;
    status = ask_once(kind, payload, answer, deadline, hub, again);
    if (status != NIF_OK || !again) return status;
    if (deadline != kNever && steady_now_ns() >= deadline) return timed_out();
  }
}

bool RequestTable::ask_later(proto::Kind kind, const proto::Payload& payload, Handler handler) {
  const MutexLock lock(mutex_);  // until it is posted, as in ask_once()
  const std::optional<std::uint16_t> number =
      reserve(kind, operation_of(payload), std::move(handler));
  if (!number) return false;
  if (outbound_.post(request_frame(kind, payload, *number))) return true;
  open_.erase(*number);
  return false;
}

bool RequestTable::on_answer(proto::Kind kind, const proto::ControlView& answer) {
  Handler handler;
  proto::Payload payload(proto::kControlHeaderSize + answer.body.size());
  store_le(payload.data(), answer.header.operation);
  store_le(payload.data() + 2, answer.header.request);
  std::copy(answer.body.begin(), answer.body.end(), payload.begin() + proto::kControlHeaderSize);
  {
    const MutexLock lock(mutex_);
    const auto found = open_.find(answer.header.request);
    if (found == open_.end()) return false;
    Open& open = found->second;
    const bool matches =
        open.kind == kind && (open.operation | proto::kAnswerBit) == answer.header.operation;
    // A broken one is the call's that asked, which asks once more under another number.
    if (!matches || open.state == State::answered || open.state == State::broken) return false;
    if (open.state == State::waiting && !open.handler) {
      open.state = State::answered;
      open.answer = std::move(payload);
      changed_.notify_all();
      return true;
    }
    handler = std::move(open.handler);
    open_.erase(found);
    changed_.notify_all();
  }
  if (handler) handler(payload);
  return true;
}

void RequestTable::fail_all() {
  const MutexLock lock(mutex_);
  std::erase_if(open_, [](const auto& entry) {
    return entry.second.handler || entry.second.state == State::abandoned;
  });
  for (auto& [number, open] : open_) {
    if (open.state == State::waiting) open.state = State::broken;
  }
  changed_.notify_all();
}

void RequestTable::close() {
  const MutexLock lock(mutex_);
  closed_ = true;
  changed_.notify_all();
}

}  // namespace gimnet::nif
