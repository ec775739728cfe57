#include <algorithm>
#include <memory>
#include <optional>

#include "base/clock.hpp"
#include "client/gimi/api.hpp"
#include "client/gimi/hub_records.hpp"
#include "proto/control/names.hpp"

// The C API: requests and their answers.

using namespace gimnet;
using namespace gimnet::gimi;

namespace {

static_assert(GIMI_REQUEST_TYPE == proto::gimi::kRequestType);

struct PendingObject final : Object {
  static constexpr HandleKind kKind = HandleKind::pending;
  PendingObject(SharedCore the_core, std::uint32_t the_number)
      : core(std::move(the_core)), number(the_number) {}
  ~PendingObject() override { core->requests().cancel(number); }
  void end() override { core->requests().leave(closed); }
  bool visit_source(const SourceVisitor& visitor) override {
    return core->requests().visit(number, visitor);
  }
  const SharedCore core;
  const std::uint32_t number;
  std::atomic<bool> closed{false};
};

struct AnswersObject final : Object {
  static constexpr HandleKind kKind = HandleKind::answers;
  AnswersObject(SharedCore the_core, AnswerTable::Added the_added, std::string the_name)
      : core(std::move(the_core)), added(std::move(the_added)), name(std::move(the_name)) {}
  ~AnswersObject() override {
    end();
    core->services().withdraw_accepted(name);
    core->answers().remove(added.key);
  }
  void end() override { added.queue->end({Status::closed, "the service was withdrawn"}); }
  bool visit_source(const SourceVisitor& visitor) override {
    added.queue->visit(visitor);
    return true;
  }
  const SharedCore core;
  const AnswerTable::Added added;
  const std::string name;  ///< without the node's
};

/// The memory of a gimi_request.
struct RequestStorage {
  SharedCore core;
  std::shared_ptr<AnswerQueue> queue;
  TakenRequest taken;
};

/// Finds who answers a service. Nobody: it waits for a moment where the hub cannot be sure of that.
Outcome<void> reach(Core& core, const std::string& service, std::int64_t deadline_ns) {
  if (const char* fault = proto::service_full_name_fault(service))
    return Failure{Status::bad_name, "cannot ask '" + service + "': " + fault};
  OpenRequests& requests = core.requests();
  const std::int64_t give_up_ns =
      std::min(deadline_ns, steady_now_ns() + OpenRequests::kRetryForNs);
  const auto left = [deadline_ns] { return Timeout{nif_timeout_until(deadline_ns)}; };
  std::optional<Failure> nobody;
  while (!requests.knows(service)) {
    bool answers = true;
    const auto learn = [&](const StreamTable::Stream& stream, const ServicePlace& place) {
      answers = place.destination() == 0 || place.key.type == proto::gimi::kRequestType;
      if (answers) requests.learn(service, stream, place);
    };
    const auto listed = listed_service(core, service, left());
    if (listed && listed->direction == Direction::provides) {
      return Failure{Status::not_found, "cannot ask " + service +
                                            ": it gives data and answers nothing; subscribe to it"};
    }
    const auto stream = listed ? stream_to_service(core, *listed, {}, left(), learn)
                               : Outcome<StreamTable::Stream>(listed.failure());
    if (stream && !answers) {
      return Failure{Status::not_found,
                     "cannot ask " + service + ": it takes commands and answers nothing"};
    }
    if (stream.is(Status::timeout) && nobody) return *nobody;
    if (!stream && !stream.is(Status::not_found)) return stream.failure();
    if (stream && requests.knows(service)) break;
    const std::string node = service.substr(0, service.rfind('/'));
    nobody = Failure{Status::not_found, "cannot ask " + service +
                                            (stream ? ": there is no way to its hub at the moment"
                                                    : ": nobody answers there at the moment")};
    if (is_over(give_up_ns) || (!stream && !may_come(core.node(), node, left()))) return *nobody;
    requests.wait_for_place(service,
                            std::min(give_up_ns, steady_now_ns() + OpenRequests::kRetryNs));
  }
  return {};
}

Outcome<std::uint32_t> begin(Core& core, const std::string& service, BytesView data,
                             const gimi_request_options& given) {
  RequestOptions options;
  if (!read_lane(given.lane, options.lane))
    return Failure{Status::bad_argument, "there is no lane " + std::to_string(given.lane)};
  options.repeat = given.repeat != 0;
  const std::int64_t deadline = deadline_after(timeout_in_options(given.timeout_ms));
  const auto reached = reach(core, service, deadline);
  if (!reached) return reached.failure();
  return core.requests().open(service, data, deadline, options);
}

gimi_status end(Ended end, gimi_reply& reply) {
  reply.ended = 1;
  reply.ran = static_cast<gimi_ran>(end.ran);
  reply.code = end.code;
  if (!end) return fail({end.status, std::move(end.sentence)});
  auto storage = std::make_unique<Message>(std::move(end.message));
  reply.data = storage->c_message().data;
  reply.size = storage->size();
  reply.from = storage->from().id;
  reply.storage = storage.release();
  return GIMI_OK;
}

/// Calls `body` with the options, and with the node and what a request says.
template <class Body>
gimi_status with_request(gimi_handle node, const char* service, const gimi_bytes* data,
                         const gimi_request_options* options, const Body& body) {
  if (service == nullptr) return is_null("the service of a request");
  if (data != nullptr && data->data == nullptr && data->size != 0)
    return is_null("the data of a request");
  return with<NodeObject>(node, [&](NodeObject& found) {
    return with_options(options, "ask", "gimi_request_options", [&](const auto& given) {
      return body(found, begin(*found.core, service, bytes_of(data), given));
    });
  });
}

/// Calls `body` with what a request owns, unless it is empty, or its process is another one.
template <class Body>
gimi_status with_taken(gimi_request* request, const Body& body) {
  if (request == nullptr || request->storage == nullptr) return is_null("the request");
  return guarded([&] {
    auto& storage = *static_cast<RequestStorage*>(request->storage);
    if (storage.core->home().left())
      return fail(GIMI_FORKED, "the request belongs to the parent process");
    return answer(body(*storage.queue, storage.taken.name));
  });
}

}  // namespace

extern "C" {

gimi_status gimi_ask(gimi_handle node, const char* service, const gimi_bytes* data,
                     const gimi_request_options* options, gimi_reply* reply) {
  if (reply == nullptr) return is_null("gimi_ask(): reply");
  *reply = {};
  reply->ended = 1;
  if (is_in_callback()) {
    return fail(GIMI_BAD_ARGUMENT,
                "cannot wait for a reply inside a callback, since all others would wait too: ask "
                "with request_later() or gimi_ask_later(), and wait for it as for the rest");
  }
  return with_request(node, service, data, options, [&](NodeObject& found, const auto& number) {
    if (!number) return fail(number.failure());
    auto ended = found.core->requests().wait(*number, INT64_MAX);
    return end(std::move(*ended), *reply);
  });
}

gimi_status gimi_ask_later(gimi_handle node, const char* service, const gimi_bytes* data,
                           const gimi_request_options* options, gimi_handle* pending) {
  if (pending == nullptr) return is_null("gimi_ask_later(): pending");
  *pending = 0;
  return with_request(node, service, data, options, [&](NodeObject& found, const auto& number) {
    if (!number) return fail(number.failure());
    return give<PendingObject>(pending, found.core, *number);
  });
}

gimi_status gimi_wait_for_reply(gimi_handle pending, int32_t timeout_ms, gimi_reply* reply) {
  if (reply == nullptr) return is_null("gimi_wait_for_reply(): reply");
  *reply = {};
  return with<PendingObject>(pending, [&](PendingObject& found) {
    auto ended = found.core->requests().wait(found.number, deadline_after(timeout_of(timeout_ms)),
                                             &found.closed);
    if (ended) return end(std::move(*ended), *reply);
    return fail(GIMI_TIMEOUT, "the request has not ended within the time given");
  });
}

void gimi_reply_release(gimi_reply* reply) {
  if (reply == nullptr) return;
  delete static_cast<Message*>(reply->storage);
  *reply = {};
}

gimi_status gimi_answer(gimi_handle node, const char* name, const gimi_answer_options* options,
                        gimi_handle* answers) {
  if (answers != nullptr) *answers = 0;
  if (name == nullptr || answers == nullptr) return is_null("gimi_answer(): name or answers");
  return with<NodeObject>(node, [&](NodeObject& found) {
    return with_options(options, "answer", "gimi_answer_options", [&](const auto& given) {
      Core& core = *found.core;
      const std::string own_name = core.state().name;
      auto added = core.answers().add(own_name + "/" + name);
      AcceptOptions how;
      how.key = added.key;
      how.metadata = text_of(given.metadata);
      const auto accepted =
          core.services().accept(own_name, name, how, timeout_in_options(given.timeout_ms));
      if (!accepted) {
        core.answers().remove(added.key);
        return fail(accepted.failure());
      }
      return give<AnswersObject>(answers, found.core, std::move(added), name);
    });
  });
}

gimi_status gimi_next_request(gimi_handle answers, int32_t timeout_ms, gimi_request* request) {
  if (request == nullptr) return is_null("gimi_next_request(): request");
  *request = {};
  return with<AnswersObject>(answers, [&](AnswersObject& found) -> gimi_status {
    auto taken = found.added.queue->receive(timeout_of(timeout_ms));
    if (!taken) return fail(taken.failure());
    auto storage = std::make_unique<RequestStorage>(
        RequestStorage{found.core, found.added.queue, std::move(*taken)});
    const gimi_message& message = storage->taken.message.c_message();
    request->data = message.data;
    request->size = message.size;
    request->left_ms = storage->taken.left_ms;
    request->arrival_ns = message.arrival_ns;
    request->from = message.from;
    request->content = message.content;
    request->storage = storage.release();
    return GIMI_OK;
  });
}

gimi_status gimi_reply_to(gimi_request* request, const void* data, size_t size,
                          int32_t timeout_ms) {
  if (data == nullptr && size != 0) return is_null("gimi_reply_to(): data");
  return with_taken(request, [&](AnswerQueue& queue, std::uint64_t name) {
    return queue.reply(name, bytes_of(data, size), timeout_of(timeout_ms));
  });
}

gimi_status gimi_fail_request(gimi_request* request, int32_t code, const char* sentence) {
  return with_taken(request, [&](AnswerQueue& queue, std::uint64_t name) {
    const std::string words = text_of(sentence);
    return queue.fail(name, {proto::gimi::RequestFault::failed, code,
                             nif::cut_text(words, GIMI_SENTENCE_BYTES_MAX)});
  });
}

void gimi_request_release(gimi_request* request) {
  if (request == nullptr) return;
  const std::unique_ptr<RequestStorage> storage(static_cast<RequestStorage*>(request->storage));
  *request = {};
  if (storage == nullptr || storage->core->home().left()) return;
  static_cast<void>(guarded([&]() -> gimi_status {
    storage->queue->let_go(storage->taken.name);
    return GIMI_OK;
  }));
}

}  // extern "C"
