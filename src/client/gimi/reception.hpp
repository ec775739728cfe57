#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "client/gimi/accepted_service.hpp"
#include "client/gimi/answer_queue.hpp"
#include "client/gimi/clerk.hpp"
#include "client/gimi/inbox.hpp"
#include "client/gimi/loss_tally.hpp"
#include "client/gimi/open_requests.hpp"
#include "client/gimi/ping_table.hpp"
#include "client/gimi/received_streams.hpp"
#include "client/gimi/service_table.hpp"
#include "client/gimi/stream_table.hpp"
#include "client/gimi/uplink.hpp"
#include "gimnet/nif.h"
#include "proto/gimi/message_header.hpp"
#include "proto/gimi/request.hpp"

namespace gimnet::gimi {

/// For NIF: a message or event of a service that is still on its way into the table comes again.
[[nodiscard]] inline nif_verdict verdict_of(ServiceTable::Place place) {
  return place == ServiceTable::Place::not_yet ? NIF_NOT_NOW : NIF_DONE;
}

/// Takes what other nodes sent, and the hub's reports of what this node sent: puts messages into
/// their queues, and tells streams and pings of their answers. Other nodes write what it reads, so
/// it drops and counts what it cannot read. Thread safety: the library's thread. Ownership: its
/// parts outlive it. Limits: those of its parts, and `message_bytes_max`.
class Reception {
 public:
  struct Parts {
    const Uplink& uplink;
    Inbox& inbox;
    StreamTable& streams;
    ServiceTable& services;
    PingTable& pings;
    OpenRequests& requests;
    AnswerTable& answers;
    AcceptedTable& accepted;
    Clerk& clerk;
    LossTally& losses;
  };
  /// `message_bytes_max`: of the application's bytes of one message.
  Reception(const Parts& parts, std::size_t message_bytes_max)
      : uplink_(parts.uplink),
        inbox_(parts.inbox),
        streams_(parts.streams),
        services_(parts.services),
        pings_(parts.pings),
        requests_(parts.requests),
        answers_(parts.answers),
        accepted_(parts.accepted),
        clerk_(parts.clerk),
        losses_(parts.losses),
        message_bytes_max_(message_bytes_max) {}

  /// NIF_KEEP: a queue has it, with its storage.
  [[nodiscard]] nif_verdict on_message(const nif_incoming& in);
  void on_report(const nif_incoming& in);
  /// A NIF_GAP of one message that is larger than this node takes, with its beginning: its sender
  /// or its subscribers are told.
  void on_too_large(const nif_incoming& in);
  /// Messages that come from now on came behind another break.
  void on_reconnected() { ++reconnects_; }

 private:
  [[nodiscard]] nif_verdict on_data(const nif_incoming& in, const proto::gimi::MessageView& view);
  [[nodiscard]] nif_verdict on_request(const nif_incoming& in,
                                       const proto::gimi::MessageView& view);
  [[nodiscard]] nif_verdict on_reply(const nif_incoming& in, const proto::gimi::MessageView& view,
                                     bool too_large);
  /// A message without a GIMI header.
  [[nodiscard]] nif_verdict on_plain(const nif_incoming& in);
  [[nodiscard]] nif_verdict on_group_data(const nif_incoming& in,
                                          const proto::gimi::MessageView& view);
  /// The own service to which a message was sent; none: to the node itself. Nothing: it is dropped
  /// or comes again, as `verdict` says.
  [[nodiscard]] std::optional<AcceptedTable::Service> accepting(const nif_incoming& in,
                                                                nif_verdict& verdict);
  /// A message of a service, for its readers.
  [[nodiscard]] nif_verdict put(SubscribedService& service,
                                const std::optional<SubscribedService::Position>& position,
                                Message message);
  /// The message, which tells its age if it came with one and the hub's clock is known.
  [[nodiscard]] Message with_age(Message message, const nif_incoming& in) const;
  /// Of a stream that its sender has begun anew since.
  [[nodiscard]] nif_verdict drop_outdated();
  /// A DATA that is larger than this node takes, and came whole: its sender is told if it waits for
  /// an ACK, and subscribers count it.
  [[nodiscard]] nif_verdict refuse(const nif_incoming& in, const proto::gimi::MessageView& view);
  /// The largest message that this node takes, for people.
  [[nodiscard]] std::string limit_words() const;
  /// Tells the sender of a DATA that it is too large. `size`: of the DATA, for people.
  void tell_too_large(const nif_incoming& in, const proto::gimi::MessageHeader& data,
                      const std::string& size);
  /// A DATA of a service that this node subscribed does not come into its queues.
  void miss(const nif_incoming& in, const proto::gimi::MessageHeader& data);
  /// The answer to a REQUEST that nobody here gets.
  void answer_fault(const nif_incoming& in, const proto::gimi::MessageHeader& request,
                    proto::gimi::RequestFault fault);
  void on_ack(const nif_incoming& in, const proto::gimi::MessageView& view);
  void on_error(const nif_incoming& in, const proto::gimi::MessageView& view);
  void on_ping(const nif_incoming& in, const proto::gimi::MessageView& view);

  const Uplink& uplink_;
  Inbox& inbox_;
  StreamTable& streams_;
  ServiceTable& services_;
  PingTable& pings_;
  OpenRequests& requests_;
  AnswerTable& answers_;
  AcceptedTable& accepted_;
  Clerk& clerk_;
  LossTally& losses_;
  const std::size_t message_bytes_max_;
  ReceivedStreams received_;
  std::uint32_t reconnects_ = 0;
};

}  // namespace gimnet::gimi
