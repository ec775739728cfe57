#include <algorithm>

#include "client/gimi/api.hpp"
#include "client/gimi/hub_records.hpp"

// The C API: streams to nodes and to services that accept.

using namespace gimnet;
using namespace gimnet::gimi;

namespace {

/// Reads the options and calls `body` with them.
template <class Body>
gimi_status with_send_options(const gimi_send_options* options, const Body& body) {
  return with_options(options, "send", "gimi_send_options", [&](const auto& given) {
    SendOptions how;
    how.key = key_of(given.key);
    if (!read_lane(given.lane, how.lane)) return bad_lane(given.lane);
    how.window = given.window;
    if (given.at_full < GIMI_WAIT || given.at_full > GIMI_HOLD_LATEST)
      return fail(GIMI_BAD_ARGUMENT, "at_full is none of GIMI_WAIT, GIMI_SKIP, GIMI_HOLD_LATEST");
    how.at_full = static_cast<AtFullWindow>(given.at_full);
    how.timestamp = given.timestamp != 0;
    how.age_ms_max = given.age_ms_max;
    how.end_at_loss = given.end_at_loss != 0;
    how.wait_if_away = given.wait_if_away != 0;
    return body(how);
  });
}

AtAway at_away(const SendOptions& options) {
  return options.wait_if_away ? AtAway::wait : AtAway::refuse;
}

}  // namespace

namespace gimnet::gimi {

Outcome<ServiceRecord> listed_service(Core& core, const std::string& name, Timeout timeout) {
  if (name.find('/') == std::string::npos) {
    return Failure{Status::bad_name, "cannot send to '" + name +
                                         "': a text names a service, as in robot/drive; find() "
                                         "gives the node of a name"};
  }
  const auto found = list_services(core.node(), name, timeout, "find the service '" + name + "'");
  if (!found) return found.failure();
  // The listing takes patterns, too: only the service of that very name counts.
  const auto service = std::ranges::find(*found, name, &ServiceRecord::name);
  if (service != found->end()) return *service;
  return Failure{Status::not_found,
                 "cannot send to '" + name +
                     "': there is no such service at the moment; watch() tells when there is"};
}

Outcome<StreamTable::Stream> stream_to_service(Core& core, const ServiceRecord& service,
                                               const SendOptions& options, Timeout timeout,
                                               const OnPlace& on_place) {
  const std::string& name = service.name;
  if (service.direction != Direction::accepts) {
    return Failure{Status::not_found,
                   "cannot send to '" + name + "': it gives data and takes none; subscribe to it"};
  }
  if (service.answers() && !on_place) {
    return Failure{Status::not_found,
                   "cannot send to '" + name +
                       "': it answers questions and takes no data; ask it by request()"};
  }
  StreamTable& streams = core.streams();
  if (const auto ended = streams.make_place(name))
    core.services().unfollow(*ended, [&] { return streams.has_service(*ended); });
  return core.services().follow(name, timeout, [&](const ServicePlace& place) {
    auto stream = streams.service_stream(name, place, options);
    if (stream && on_place) on_place(*stream, place);
    return stream;
  });
}

}  // namespace gimnet::gimi

extern "C" {

gimi_status gimi_accept(gimi_handle node, const char* name, const gimi_accept_options* options,
                        gimi_handle* accepted) {
  if (accepted != nullptr) *accepted = 0;
  if (name == nullptr || accepted == nullptr) return is_null("gimi_accept(): name or accepted");
  return with<NodeObject>(node, [&](NodeObject& found) {
    return with_options(options, "accept", "gimi_accept_options", [&](const auto& given) {
      const gimi_bytes& safe = given.safe_message;
      if (given.lease_ms != 0 || safe.data != nullptr || safe.size != 0)
        return fail(GIMI_BAD_ARGUMENT, "this version of the library has no lease of a service");
      AcceptOptions how;
      how.key = key_of(given.key);
      how.queue.messages = given.messages;
      if (!read_at_full(given.at_full, how.queue.at_full)) return bad_at_full();
      if (given.messages > GIMI_QUEUE_MESSAGES_MAX) return bad_length(given.messages);
      how.metadata = text_of(given.metadata);
      Core& core = *found.core;
      const std::string own_name = core.state().name;
      AcceptedTable::Service service = core.accepted().add(own_name, name, how.queue);
      const auto group =
          core.services().accept(own_name, name, how, timeout_in_options(given.timeout_ms));
      if (!group) {
        core.accepted().remove(service);
        return fail(group.failure());
      }
      core.accepted().place(service, *group);
      return give<AcceptedObject>(accepted, found.core, std::move(service));
    });
  });
}

gimi_status gimi_sender_to_service(gimi_handle node, const char* full_name,
                                   const gimi_send_options* options, int32_t timeout_ms,
                                   gimi_handle* sender) {
  if (sender != nullptr) *sender = 0;
  if (full_name == nullptr || sender == nullptr)
    return is_null("gimi_sender_to_service(): full_name or sender");
  return with<NodeObject>(node, [&](NodeObject& found) {
    return with_send_options(options, [&](const SendOptions& how) {
      StreamTable::Stream stream = found.core->streams().standing(full_name);
      // A request to it made that stream: its refusal comes from the hub's answer.
      if (stream != nullptr && found.core->requests().knows(full_name)) stream = nullptr;
      if (stream == nullptr) {
        const std::int64_t deadline = deadline_after(timeout_of(timeout_ms));
        const auto left = [deadline] { return Timeout{nif_timeout_until(deadline)}; };
        const auto listed = listed_service(*found.core, full_name, left());
        if (!listed) return fail(listed.failure());
        auto made = stream_to_service(*found.core, *listed, how, left());
        if (!made) return fail(made.failure());
        stream = std::move(*made);
      }
      if (const auto failure = conflict(*stream, how)) return fail(*failure);
      return give<SenderObject>(sender, found.core, std::move(stream), at_away(how));
    });
  });
}

gimi_status gimi_sender(gimi_handle node, gimi_peer to, const gimi_send_options* options,
                        gimi_handle* sender) {
  if (sender == nullptr) return is_null("gimi_sender(): sender");
  *sender = 0;
  return with<NodeObject>(node, [&](NodeObject& found) {
    return with_send_options(options, [&](const SendOptions& how) {
      auto stream = found.core->streams().stream(Peer{to}, how);
      if (!stream) return fail(stream.failure());
      return give<SenderObject>(sender, found.core, std::move(*stream), at_away(how));
    });
  });
}

gimi_status gimi_send(gimi_handle sender, const void* data, size_t size, int32_t timeout_ms,
                      int32_t more) {
  if (data == nullptr && size != 0) return is_null("gimi_send(): data");
  return with<SenderObject>(sender, [&](SenderObject& found) {
    return answer(found.stream->send(bytes_of(data, size), timeout_of(timeout_ms),
                                     more != 0 ? More::yes : More::no, found.at_away));
  });
}

gimi_status gimi_try_send(gimi_handle sender, const void* data, size_t size, int32_t timeout_ms,
                          int32_t more) {
  if (data == nullptr && size != 0) return is_null("gimi_try_send(): data");
  return with<SenderObject>(sender, [&](SenderObject& found) {
    return answer(found.stream->send(bytes_of(data, size), timeout_of(timeout_ms),
                                     more != 0 ? More::yes : More::no, found.at_away,
                                     AtTimeout::try_again));
  });
}

gimi_status gimi_send_confirmed(gimi_handle sender, const void* data, size_t size,
                                int32_t timeout_ms) {
  if (data == nullptr && size != 0) return is_null("gimi_send_confirmed(): data");
  return with<SenderObject>(sender, [&](SenderObject& found) {
    return answer(
        found.stream->send_confirmed(bytes_of(data, size), timeout_of(timeout_ms), found.at_away));
  });
}

gimi_status gimi_settle(gimi_handle sender, int32_t timeout_ms) {
  return with<SenderObject>(sender, [&](SenderObject& found) {
    return answer(found.stream->settle(timeout_of(timeout_ms)));
  });
}

gimi_status gimi_sent(gimi_handle sender, gimi_send_counts* counts) {
  return with<SenderObject>(sender, [&](SenderObject& found) -> gimi_status {
    if (!nif::has_size(counts)) return is_null("gimi_sent(): counts, or its struct_size,");
    const SendCounts now = found.stream->counts();
    gimi_send_counts whole{};
    whole.sent = now.sent;
    whole.acknowledged = now.acknowledged;
    whole.lost = now.lost;
    whole.skipped = now.skipped;
    whole.waiting = now.waiting;
    whole.loss_reason = static_cast<gimi_loss_reason>(now.loss_reason);
    copy_text(now.loss, whole.loss, sizeof whole.loss);
    nif::write_struct(whole, *counts);
    return GIMI_OK;
  });
}

gimi_peer gimi_sends_to(gimi_handle sender) {
  gimi_peer peer = 0;
  static_cast<void>(with<SenderObject>(sender, [&](SenderObject& found) -> gimi_status {
    peer = found.stream->to().id;
    return GIMI_OK;
  }));
  return peer;
}

gimi_status gimi_send_to(gimi_handle node, gimi_peer to, const gimi_bytes* data,
                         const gimi_send_options* options, int32_t timeout_ms) {
  if (data == nullptr || (data->data == nullptr && data->size != 0))
    return is_null("gimi_send_to(): data");
  return with_core(node, [&](Core& core) {
    return with_send_options(options, [&](const SendOptions& how) {
      const auto stream = core.streams().stream(Peer{to}, how);
      if (!stream) return fail(stream.failure());
      return answer((*stream)->send(bytes_of(data), timeout_of(timeout_ms), More::no));
    });
  });
}

}  // extern "C"
