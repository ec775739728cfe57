#include "client/gimi/open_requests.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include "base/clock.hpp"
#include "client/gimi/loss_tally.hpp"
#include "gimnet/gimi_options.h"
#include "proto/frame/report.hpp"

namespace gimnet::gimi {
namespace {

using proto::gimi::RequestFault;

Ended without_reply(Status status, Ran ran, std::string sentence) {
  return {status, std::move(sentence), ran, 0, {}};
}

/// `unsure`: it was sent before, and may have been done by that.
Ended reply_of(const proto::gimi::RequestError& error, const std::string& service, bool unsure) {
  const std::string words = service + ": ";
  const Ran not_done = unsure ? Ran::maybe : Ran::no;
  switch (error.fault) {
    case RequestFault::failed:
      return {Status::failed, words + std::string(error.sentence), Ran::yes, error.code, {}};
    case RequestFault::busy:
      return without_reply(Status::busy, not_done, words + "too many requests wait there");
    case RequestFault::late:
      return without_reply(Status::timeout, not_done, words + "the request came too late");
    case RequestFault::nobody:
    case RequestFault::withdrawn:
      return without_reply(Status::not_found, not_done, words + "nobody answers there any more");
    case RequestFault::too_large:
      return without_reply(Status::too_large, not_done,
                           words + "the request is too large" +
                               (error.sentence.empty() ? "" : ": ") + std::string(error.sentence));
    case RequestFault::let_go:
      return without_reply(Status::gone, Ran::maybe,
                           words + "the program took the request and did not answer it");
    case RequestFault::unknown:
      break;
  }
  return without_reply(Status::gone, Ran::maybe,
                       words + "nobody there knows what became of the request");
}

Ended gone(const std::string& service) {
  return without_reply(Status::gone, Ran::maybe, service + ": the program that was asked has gone");
}

/// The way there may be back soon.
bool may_come_back(std::uint32_t reason) {
  switch (static_cast<proto::DropReason>(reason)) {
    case proto::DropReason::no_such_node:
    case proto::DropReason::no_such_group:
    case proto::DropReason::no_route:
    case proto::DropReason::away:
      return true;
    default:
      return false;
  }
}

}  // namespace

bool OpenRequests::knows_locked(const std::string& service) const {
  const auto found = services_.find(service);
  return found != services_.end() && found->second.place.destination() != 0;
}

bool OpenRequests::knows(const std::string& service) {
  const MutexLock lock(mutex_);
  if (!knows_locked(service)) return false;
  services_.find(service)->second.asked = ++asked_;
  return true;
}

void OpenRequests::wait_for_place(const std::string& service, std::int64_t until_ns) {
  const MutexLock lock(mutex_);
  while (!end_ && !knows_locked(service) && !is_over(until_ns))
    static_cast<void>(ended_.wait_until(mutex_, until_ns));
}

void OpenRequests::learn(const std::string& service, StreamTable::Stream stream,
                         const ServicePlace& place) {
  const MutexLock lock(mutex_);
  services_.insert_or_assign(service, Service{std::move(stream), place, ++asked_});
  if (services_.size() <= kServicesMax) return;
  services_.erase(
      std::ranges::min_element(services_, {}, [](const auto& each) { return each.second.asked; }));
}

Outcome<std::uint32_t> OpenRequests::open(const std::string& service, BytesView data,
                                          std::int64_t deadline_ns, const RequestOptions& options) {
  if (data.size() > GIMI_MESSAGE_BYTES_MAX) {
    return Failure{Status::too_large,
                   "cannot ask " + service + ": the request is larger than 1 GiB"};
  }
  // Before it is an open one: there may be no memory.
  auto kept =
      std::make_shared<const std::vector<std::byte>>(data.span().begin(), data.span().end());
  std::optional<Sending> sending;
  std::uint32_t number = 0;
  {
    const MutexLock lock(mutex_);
    if (end_) return end_.failure("ask " + service);
    if (open_.size() >= kOpenMax) {
      return Failure{Status::limit, "cannot ask " + service + ": " + std::to_string(kOpenMax) +
                                        " requests of this node are open"};
    }
    while (next_ == 0 || open_.contains(next_)) ++next_;
    number = next_++;
    Open& made = open_[number];
    made.service = service;
    made.data = std::move(kept);
    made.lane = options.lane;
    made.repeat = options.repeat;
    made.deadline_ns = deadline_ns;
    sending = prepare(number, made, steady_now_ns());
    if (!sending) made.again_ns = steady_now_ns() + kRetryNs;
  }
  if (sending) {
    transmit(number, *sending, nif_timeout_until(deadline_ns));
  } else {
    attend_();
  }
  return number;
}

std::optional<OpenRequests::Sending> OpenRequests::prepare(std::uint32_t number, Open& open,
                                                           std::int64_t now_ns) {
  const auto service = services_.find(open.service);
  if (service == services_.end()) return std::nullopt;
  const ServicePlace& place = service->second.place;
  if (place.destination() == 0 || place.away) return std::nullopt;
  std::uint32_t left_ms = proto::gimi::kNoDeadline;
  if (open.deadline_ns != INT64_MAX) {
    const std::int64_t left = std::max<std::int64_t>(open.deadline_ns - now_ns, 0) / 1'000'000;
    left_ms = static_cast<std::uint32_t>(
        std::min<std::int64_t>(left, proto::gimi::kNoDeadline - std::int64_t{1}));
  }
  open.unsure |= std::exchange(open.sent, true);  // from the moment at which it is given away
  std::uint8_t flags = open.unsure ? proto::gimi::kFlagAgain : 0;
  if (open.repeat) flags |= proto::gimi::kFlagRepeat;
  open.provider = place.provider;
  open.session = place.session;
  open.instance = place.key.instance;
  open.again_ns = 0;
  Envelope envelope{place.group, NIF_SERVICE, NIF_POLICY_DEFAULT, open.lane,
                    place.key,   0,           NIF_FLAG_REPORT};
  envelope.left_ms = left_ms;
  return Sending{
      envelope, {number, proto::gimi::MessageOperation::request, flags, 0, epoch_}, open.data};
}

void OpenRequests::transmit(std::uint32_t number, const Sending& sending, std::int32_t timeout_ms) {
  const nif_status status =
      uplink_.transmit(sending.envelope, sending.header, false, *sending.data, timeout_ms);
  if (status == NIF_OK) return;
  Failure failure = failure_of(status, "send a request");
  {
    const MutexLock lock(mutex_);
    const auto found = open_.find(number);
    if (found == open_.end() || found->second.reply) return;
    Open& open = found->second;
    open.sent = false;
    // One that may have come is named again when the connection is back.
    if (status == NIF_NOT_CONNECTED && open.unsure) return;
    if (status != NIF_TIMEOUT || is_over(open.deadline_ns)) {
      return finish(open, without_reply(failure.status, open.ran(), std::move(failure.sentence)));
    }
    open.again_ns = steady_now_ns() + kRetryNs;  // the hub has paused the way
  }
  attend_();
}

void OpenRequests::finish(Open& open, Ended reply) {
  open.again_ns = 0;
  open.reply = std::move(reply);
  ended_.notify_all();
  open.source.update(true);
}

void OpenRequests::time_out(Open& open) {
  finish(open, without_reply(Status::timeout, open.ran(),
                             open.service + " did not answer within the time given"));
}

void OpenRequests::retry(Open& open, Ended otherwise) {
  const std::int64_t now = steady_now_ns();
  if (open.give_up_ns == 0) open.give_up_ns = now + kRetryForNs;
  if (now >= std::min(open.give_up_ns, open.deadline_ns)) return finish(open, std::move(otherwise));
  open.again_ns = now + kRetryNs;
}

std::optional<Ended> OpenRequests::wait(std::uint32_t number, std::int64_t until_ns,
                                        const std::atomic<bool>* left) {
  const MutexLock lock(mutex_);
  for (;;) {
    const auto found = open_.find(number);
    const bool cancelled = left != nullptr && *left;
    if (found == open_.end()) {
      return without_reply(Status::closed, Ran::maybe,
                           cancelled ? "the request was cancelled" : "it has ended");
    }
    Open& open = found->second;
    if (!open.reply && is_over(open.deadline_ns)) time_out(open);
    if (open.reply) {
      std::optional<Ended> reply = std::move(open.reply);
      open_.erase(found);
      return reply;
    }
    if (cancelled) return without_reply(Status::closed, open.ran(), "the request was cancelled");
    if (is_over(until_ns)) return std::nullopt;
    static_cast<void>(ended_.wait_until(mutex_, std::min(until_ns, open.deadline_ns)));
  }
}

bool OpenRequests::visit(std::uint32_t number, const SourceVisitor& visitor) {
  bool is_member = false;
  {
    const MutexLock lock(mutex_);
    const auto found = open_.find(number);
    if (found == open_.end()) return false;
    Open& open = found->second;
    visitor(open.source, open.reply.has_value());
    is_member = open.source.is_member();
  }
  if (is_member) attend_();  // whoever waits by a set does not look at the time
  return true;
}

void OpenRequests::cancel(std::uint32_t number) {
  const MutexLock lock(mutex_);
  open_.erase(number);
}

void OpenRequests::leave(std::atomic<bool>& left) {
  const MutexLock lock(mutex_);
  left = true;
  ended_.notify_all();
}

OpenRequests::Open* OpenRequests::find(const proto::gimi::MessageHeader& header, Peer from) {
  const auto found = header.epoch == epoch_ ? open_.find(header.sequence) : open_.end();
  if (found != open_.end() && !found->second.reply && found->second.provider == from.id)
    return &found->second;
  ++dropped_;
  return nullptr;
}

bool OpenRequests::on_reply(const proto::gimi::MessageHeader& header, Message& reply,
                            bool too_large) {
  const MutexLock lock(mutex_);
  Open* const open = find(header, reply.from());
  if (open == nullptr) return false;
  if (too_large) {
    finish(*open, without_reply(Status::too_large, Ran::maybe,
                                open->service + ": the reply is larger than this node takes"));
    return false;
  }
  finish(*open, Ended{Status::ok, "", Ran::yes, 0, std::move(reply)});
  return true;
}

bool OpenRequests::on_error(const proto::gimi::MessageHeader& header, Peer from,
                            const proto::gimi::RequestError& error) {
  const MutexLock lock(mutex_);
  Open* const open = find(header, from);
  if (open == nullptr) return false;
  finish(*open, reply_of(error, open->service, open->unsure));
  return true;
}

void OpenRequests::on_report(std::uint32_t sequence, std::uint32_t reason,
                             const std::string& words) {
  {
    const MutexLock lock(mutex_);
    const auto found = open_.find(sequence);
    if (found == open_.end() || found->second.reply) return;
    Open& open = found->second;
    open.sent = false;
    open.unsure |= reason == NIF_DROP_LINK_UNSURE;
    Ended otherwise =
        without_reply(dropped_status(reason), open.ran(), open.service + ": " + words);
    if (!may_come_back(reason)) return finish(open, std::move(otherwise));
    // It waits as long as it may for a node that is only away.
    if (reason == NIF_DROP_AWAY) open.give_up_ns = INT64_MAX;
    retry(open, std::move(otherwise));
    if (reason == NIF_DROP_AWAY) open.give_up_ns = 0;
  }
  attend_();
}

void OpenRequests::on_service_moved(const std::string& service, const ServicePlace& place) {
  {
    const MutexLock lock(mutex_);
    const auto known = services_.find(service);
    if (known == services_.end()) return;
    known->second.place = place;
    const bool is_there = place.destination() != 0;
    for (auto& [number, open] : open_) {
      if (open.service != service || open.reply) continue;
      const bool same = place.provider == open.provider && place.session == open.session &&
                        place.key.instance == open.instance;
      if (open.may_have_come() && !(is_there && same)) {
        ask_the_next(open, is_there);
      } else if (is_there && !place.away && open.again_ns != 0) {
        open.again_ns = steady_now_ns();
      }
    }
    ended_.notify_all();  // wait_for_place()
  }
  attend_();
}

void OpenRequests::find_nobody(Open& open, std::int64_t now_ns) {
  const auto service = services_.find(open.service);
  if (service != services_.end() && service->second.place.away) {
    open.again_ns = now_ns + kRetryNs;
    return;
  }
  retry(open, open.may_have_come()
                  ? gone(open.service)
                  : without_reply(Status::not_found, Ran::no, open.service + ": nobody answers"));
}

void OpenRequests::ask_the_next(Open& open, bool is_there) {
  if (!open.repeat) return finish(open, gone(open.service));
  if (is_there) open.give_up_ns = 0;
  open.again_ns = steady_now_ns();
}

void OpenRequests::on_broken() {
  {
    const MutexLock lock(mutex_);
    for (auto& [number, open] : open_) {
      if (open.reply) continue;
      open.give_up_ns = 0;
      if (open.again_ns == 0) open.again_ns = steady_now_ns() + kRetryNs;
    }
    if (open_.empty()) return;
  }
  attend_();
}

void OpenRequests::end(const Ending& ending) {
  const MutexLock lock(mutex_);
  end_ = ending;
  for (auto& [number, open] : open_) {
    if (open.reply) continue;
    const Failure failure = ending.failure("ask " + open.service);
    finish(open, without_reply(failure.status, open.ran(), failure.sentence));
  }
  services_.clear();
  ended_.notify_all();
}

bool OpenRequests::tick(std::int64_t now_ns) {
  std::vector<std::pair<std::uint32_t, Sending>> due;
  bool more = false;
  {
    const MutexLock lock(mutex_);
    for (auto& [number, open] : open_) {
      if (open.source.is_member() && !open.reply && open.deadline_ns != INT64_MAX) {
        more = true;
        if (open.deadline_ns <= now_ns) time_out(open);
      }
      if (open.again_ns == 0) continue;
      more = true;
      if (now_ns >= open.deadline_ns) time_out(open);
      if (open.again_ns > now_ns || open.reply) continue;
      if (auto sending = prepare(number, open, now_ns)) {
        due.emplace_back(number, std::move(*sending));
      } else {
        find_nobody(open, now_ns);
      }
    }
  }
  for (const auto& [number, sending] : due) transmit(number, sending, 0);
  return more;
}

std::uint64_t OpenRequests::dropped() {
  const MutexLock lock(mutex_);
  return dropped_;
}

}  // namespace gimnet::gimi
