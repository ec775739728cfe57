#include "client/gimi/answer_queue.hpp"

#include <algorithm>
#include <utility>

#include "base/clock.hpp"
#include "client/gimi/message.hpp"

namespace gimnet::gimi {
namespace {

using proto::gimi::MessageOperation;
using proto::gimi::RequestFault;

std::uint64_t name_of(const proto::gimi::MessageHeader& header) {
  return (std::uint64_t{header.epoch} << 32) | header.sequence;
}

}  // namespace

Outcome<TakenRequest> AnswerQueue::receive(Timeout timeout) {
  const std::int64_t deadline = deadline_after(timeout);
  const MutexLock lock(mutex_);
  for (drop_late(); waiting_.empty(); drop_late()) {
    if (end_) return end_.failure("take a request to " + service_);
    if (is_over(deadline))
      return Failure{Status::timeout, "no request came to " + service_ + " in the time given"};
    static_cast<void>(filled_.wait_until(mutex_, deadline));
  }
  Waiting next = std::move(waiting_.front());
  waiting_.pop_front();
  waiting_bytes_ -= next.message.size();
  source_.update(!waiting_.empty() || end_);
  const std::int64_t left_ns = std::max<std::int64_t>(next.deadline_ns - steady_now_ns(), 0);
  const std::int64_t left_ms = next.deadline_ns == INT64_MAX ? -1 : left_ns / 1'000'000;
  return TakenRequest{std::move(next.message), next.name, left_ms};
}

void AnswerQueue::drop_late() {
  for (auto each = waiting_.begin(); each != waiting_.end();) {
    if (!is_over(each->deadline_ns)) {
      ++each;
      continue;
    }
    const auto open = open_.extract(each->name);
    if (!open.empty()) refuse(open.mapped().way, each->name, RequestFault::late);
    waiting_bytes_ -= each->message.size();
    each = waiting_.erase(each);
  }
  source_.update(!waiting_.empty() || end_);
}

nif_status AnswerQueue::send(const Way& way, std::uint64_t name, MessageOperation operation,
                             BytesView data, std::int32_t timeout_ms) const {
  const Envelope envelope{way.to.id, NIF_UNICAST, NIF_POLICY_DEFAULT, way.lane, way.key, 0, 0};
  return uplink_.transmit(
      envelope,
      {static_cast<std::uint32_t>(name), operation, 0, 0, static_cast<std::uint32_t>(name >> 32)},
      false, data, timeout_ms);
}

/// Does not wait: if the way is full, the time of the request tells.
void AnswerQueue::refuse(const Way& way, std::uint64_t name, RequestFault fault) const {
  static_cast<void>(send(way, name, MessageOperation::error,
                         proto::gimi::encode_request_error({fault, 0, ""}), 0));
}

Outcome<void> AnswerQueue::answer(std::uint64_t name, MessageOperation operation, BytesView data,
                                  Timeout timeout) {
  Way way;
  {
    const MutexLock lock(mutex_);
    const auto open = open_.find(name);
    if (open == open_.end() || open->second.is_being_answered) {
      return Failure{Status::closed, "cannot answer the request to " + service_ +
                                         ": it was answered already, or its service has ended"};
    }
    open->second.is_being_answered = true;
    open->second.came_again = false;
    way = open->second.way;
  }
  const nif_status status = send(way, name, operation, data, nif_timeout(timeout));
  Outcome<void> outcome;
  if (status != NIF_OK) outcome = failure_of(status, "answer the request to " + service_);
  const MutexLock lock(mutex_);
  const auto found = open_.find(name);
  if (found == open_.end()) return outcome;
  Open& open = found->second;
  open.is_being_answered = false;
  // After a failure the program may try again, or answer with an error. A closed node sends
  // nothing any more.
  if (status != NIF_OK && status != NIF_CLOSED) return outcome;
  if (open.came_again) static_cast<void>(send(open.way, name, operation, data, 0));
  close(name, operation, data);
  return outcome;
}

void AnswerQueue::close(std::uint64_t name, MessageOperation operation, BytesView data) {
  open_.erase(name);
  if (data.size() <= kAnswerBytesMax)
    keep({name, operation, {data.span().begin(), data.span().end()}});
}

Outcome<void> AnswerQueue::reply(std::uint64_t name, BytesView data, Timeout timeout) {
  return answer(name, MessageOperation::reply, data, timeout);
}

Outcome<void> AnswerQueue::fail(std::uint64_t name, const proto::gimi::RequestError& error) {
  const auto data = proto::gimi::encode_request_error(error);
  return answer(name, MessageOperation::error, data, Timeout{kLeaveTimeoutMs});
}

void AnswerQueue::let_go(std::uint64_t name) {
  const proto::gimi::RequestError error{RequestFault::let_go, 0, ""};
  if (fail(name, error)) return;
  const MutexLock lock(mutex_);
  // If the error found no way, the asking program gets it when it asks again.
  if (open_.contains(name))
    close(name, MessageOperation::error, proto::gimi::encode_request_error(error));
}

void AnswerQueue::keep(Answer answer) {
  answer_bytes_ += answer.data.size();
  answers_.push_back(std::move(answer));
  while (answers_.size() > kAnswersMax || answer_bytes_ > kAnswerBytesMax) {
    answer_bytes_ -= answers_.front().data.size();
    answers_.pop_front();
  }
}

void AnswerQueue::remember(std::uint64_t name) {
  if (!came_.insert(name).second) return;
  names_.push_back(name);
  if (names_.size() <= kNamesMax) return;
  came_.erase(names_.front());
  names_.pop_front();
}

bool AnswerQueue::on_request(const proto::gimi::MessageHeader& header, Message& message,
                             std::uint32_t left_ms) {
  const std::uint64_t name = name_of(header);
  const Way way{message.from(), message.lane(), message.key()};
  const bool again = header.has(proto::gimi::kFlagAgain);
  const MutexLock lock(mutex_);
  if (end_) {
    refuse(way, name, RequestFault::withdrawn);
    return false;
  }
  const bool known = came_.contains(name);
  if (known) {
    if (const auto open = open_.find(name); open != open_.end()) {
      open->second.way = way;  // the asking node may have another id now
      open->second.came_again = true;
      return false;
    }
    const auto kept = std::ranges::find(answers_, name, &Answer::name);
    if (kept != answers_.end()) {
      static_cast<void>(send(way, name, kept->operation, kept->data, 0));
      return false;
    }
  }
  // Also the first of two that came behind the second.
  const bool may_have_come = known || (again && names_.size() == kNamesMax);
  if (may_have_come && !header.has(proto::gimi::kFlagRepeat)) {
    if (again) refuse(way, name, RequestFault::unknown);
    return false;
  }
  if (is_full()) drop_late();
  if (is_full()) {
    refuse(way, name, RequestFault::busy);
    return false;
  }
  remember(name);
  open_.insert_or_assign(name, Open{way});
  const bool limited = left_ms != proto::gimi::kNoDeadline;
  const std::int64_t deadline =
      limited ? steady_now_ns() + std::int64_t{left_ms} * 1'000'000 : INT64_MAX;
  waiting_bytes_ += message.size();
  waiting_.push_back({std::move(message), name, deadline});
  filled_.notify_one();
  source_.update(true);
  return true;
}

void AnswerQueue::end(const Ending& ending) {
  const MutexLock lock(mutex_);
  end_ = ending;
  for (const Waiting& waiting : waiting_) {
    const auto open = open_.extract(waiting.name);
    if (!open.empty()) refuse(open.mapped().way, waiting.name, RequestFault::withdrawn);
  }
  waiting_.clear();
  waiting_bytes_ = 0;
  filled_.notify_all();
  source_.update(true);
}

void AnswerQueue::visit(const SourceVisitor& visitor) {
  const MutexLock lock(mutex_);
  visitor(source_, !waiting_.empty() || end_);
}

AnswerTable::Added AnswerTable::add(const std::string& full_name) {
  auto queue = std::make_shared<AnswerQueue>(uplink_, full_name, bytes_max_);
  const MutexLock lock(mutex_);
  if (end_) queue->end(end_);
  MessageKey key{proto::gimi::kRequestType, Uplink::draw_epoch()};
  while (!queues_.emplace(key.instance, queue).second) ++key.instance;
  return {queue, key};
}

void AnswerTable::remove(MessageKey key) {
  const MutexLock lock(mutex_);
  queues_.erase(key.instance);
}

std::shared_ptr<AnswerQueue> AnswerTable::find(MessageKey key) {
  const MutexLock lock(mutex_);
  const auto found = queues_.find(key.instance);
  return key.type == proto::gimi::kRequestType && found != queues_.end() ? found->second : nullptr;
}

void AnswerTable::end(const Ending& ending) {
  const MutexLock lock(mutex_);
  end_ = ending;
  for (const auto& [instance, queue] : queues_) queue->end(ending);
}

}  // namespace gimnet::gimi
