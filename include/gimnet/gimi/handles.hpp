#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "gimnet/gimi/conversions.hpp"
#include "gimnet/gimi/message.hpp"
#include "gimnet/gimi/namespace.hpp"
#include "gimnet/gimi/node_state.hpp"
#include "gimnet/gimi/options.hpp"
#include "gimnet/gimi/outcome.hpp"
#include "gimnet/gimi/records.hpp"

// Publishers, subscriptions, queues and senders. Part of gimnet/gimi.hpp.

namespace gimnet::inline GIMNET_GIMI_NAMESPACE {

namespace detail {

[[nodiscard]] inline Outcome<Message> receive(gimi_handle source, Timeout timeout) {
  gimi_message message{};
  const gimi_status status = gimi_receive(source, milliseconds_of(timeout), &message);
  if (status != GIMI_OK) return failure_of(status);
  return Message(message);
}

[[nodiscard]] inline std::optional<Message> try_receive(gimi_handle source) {
  gimi_message message{};
  if (gimi_receive(source, 0, &message) != GIMI_OK) return std::nullopt;
  return Message(message);
}

[[nodiscard]] inline gimi_queue_counts counts(gimi_handle source) {
  gimi_queue_counts counts{};
  counts.struct_size = sizeof counts;
  static_cast<void>(gimi_counts(source, &counts));
  return counts;
}

[[nodiscard]] inline std::string service_name(gimi_handle handle) {
  std::string name(GIMI_NAME_BYTES_MAX * 2 + 2, '\0');
  static_cast<void>(gimi_service_name(handle, name.data(), name.size()));
  name.resize(name.find('\0'));
  return name;
}

}  // namespace detail

/// Messages that were received and wait: a ring buffer for one (type, instance), for one
/// subscription, or for one accepted service.
class Queue {
 public:
  /// Takes the oldest. Waits if there is none. Errors: timeout, closed.
  Outcome<Message> receive(Timeout timeout = kForever) const {
    if (!handle_) return failure_;
    return detail::receive(handle_.value(), timeout);
  }
  /// Takes the oldest; nothing if there is none.
  [[nodiscard]] std::optional<Message> try_receive() const {
    return detail::try_receive(handle_.value());
  }
  /// Takes the newest and throws the others away, which counts as taking them and not as
  /// overwriting. Nothing if there is none.
  [[nodiscard]] std::optional<Message> take_newest() const {
    gimi_message message{};
    if (gimi_receive_newest(handle_.value(), &message) != GIMI_OK) return std::nullopt;
    return Message(message);
  }

  /// Changes the size while it runs; the oldest that no longer fit go and are
  /// counted. 1..kQueueMessagesMax; other numbers count as the nearest of these.
  void resize(std::size_t messages) const {
    static_cast<void>(gimi_resize(handle_.value(), messages));
  }
  /// Messages that wait now.
  [[nodiscard]] std::size_t size() const { return detail::counts(handle_.value()).waiting; }
  /// All that ever came.
  [[nodiscard]] std::uint64_t received() const { return detail::counts(handle_.value()).received; }
  /// Went because it was full.
  [[nodiscard]] std::uint64_t overwritten() const {
    return detail::counts(handle_.value()).overwritten;
  }

  /// For the C functions, and for a WaitSet.
  [[nodiscard]] gimi_handle c_handle() const { return handle_.value(); }

  /// Made by Node and Subscription.
  explicit Queue(detail::SharedHandle handle) : handle_(std::move(handle)) {}
  explicit Queue(Failure failure) : failure_(std::move(failure)) {}

 private:
  detail::SharedHandle handle_;  ///< none: there is no queue ...
  Failure failure_;              ///< ... and why
};

/// An own service that takes data: the queue of what others send to it. Copies are the same
/// service; with the last one it ends, as a Publisher does. A Queue that is copied from it counts
/// as a copy.
class Accepted : public Queue {
 public:
  /// In full, as it is now: another one after Node::take_name().
  [[nodiscard]] std::string name() const { return detail::service_name(c_handle()); }
  /// As Publisher::standing().
  [[nodiscard]] Outcome<void> standing() const {
    return detail::outcome_of(gimi_standing(c_handle()));
  }

  /// Made by Node.
  explicit Accepted(detail::SharedHandle handle) : Queue(std::move(handle)) {}
};

/// The fate of the messages of one stream.
struct SendCounts {
  std::uint64_t sent = 0;
  std::uint64_t acknowledged = 0;
  std::uint64_t lost = 0;  ///< known not to have arrived, or their connection or route ended before
                           ///< they were told of
  std::uint64_t skipped =
      0;  ///< not sent: AtFullWindow::skip, or replaced by a newer one under hold_latest
  std::size_t waiting = 0;  ///< sent and not acknowledged yet, and one that is held
  std::string loss;         ///< why the last one was lost, in words; "" if none was
  LossReason loss_reason = LossReason::none;  ///< the same for programs
};

/// A stream of messages with one key, to one node or to whoever accepts one service. Several
/// Senders of one (peer, key), or of one service, of a node are one stream: they share sequence,
/// window and counts. The options of the first hold as long as the node lives; others are refused.
/// One to a service follows it: while nobody has the service, send() answers not_found; when it is
/// back, under whichever node and group, messages go there. Messages not acknowledged at its former
/// place count as lost. While its program is away, send() answers not_found, too, or waits
/// (SendOptions::wait_if_away): nothing comes to a program that has not accepted it yet.
class Sender {
 public:
  /// Sends 0 bytes to 1 GiB. Ok: it is on its way; of a synchronized stream, settle() and counts()
  /// tell what became of it. Waits while the window is full (AtFullWindow::wait) or the hub has
  /// paused the destination. Errors: timeout (nothing was sent), window_full, not_found (a service
  /// that nobody has, or that is away), not_connected, refused, not_delivered (also of
  /// SendOptions::end_at_loss: nothing was sent), too_large, closed.
  Outcome<void> send(BytesView data, Timeout timeout = kForever, More more = More::no) const {
    return detail::outcome_of(gimi_send(handle_.value(), data.data(), data.size(),
                                        milliseconds_of(timeout), more == More::yes ? 1 : 0));
  }
  /// send(), and waits for the acknowledgement of this one message; also without a window. Ok: it
  /// is in the queue of its receiver. Errors: not_delivered (why it is not, or may not be), timeout
  /// (the sentence says whether it was sent; if so, it may still arrive), others as send(). Waits
  /// at a full window, whatever SendOptions::at_full says.
  Outcome<void> send_confirmed(BytesView data, Timeout timeout = kForever) const {
    return detail::outcome_of(
        gimi_send_confirmed(handle_.value(), data.data(), data.size(), milliseconds_of(timeout)));
  }
  /// Waits until nothing is unacknowledged. Ok: all that was sent so far was acknowledged.
  /// Errors: not_delivered (the sentence says how many were lost and why), timeout, closed.
  Outcome<void> settle(Timeout timeout = kForever) const {
    return detail::outcome_of(gimi_settle(handle_.value(), milliseconds_of(timeout)));
  }

  [[nodiscard]] SendCounts counts() const {
    gimi_send_counts counts{};
    counts.struct_size = sizeof counts;
    static_cast<void>(gimi_sent(handle_.value(), &counts));
    return {counts.sent,
            counts.acknowledged,
            counts.lost,
            counts.skipped,
            counts.waiting,
            counts.loss,
            static_cast<LossReason>(counts.loss_reason)};
  }
  /// The node; nobody (id 0) of a stream to a service.
  [[nodiscard]] Peer peer() const { return Peer{gimi_sends_to(handle_.value())}; }
  /// The service by its full name; "" of a stream to a node.
  [[nodiscard]] std::string service() const { return detail::service_name(handle_.value()); }

  /// Made by Node.
  explicit Sender(detail::SharedHandle handle) : handle_(std::move(handle)) {}

 private:
  detail::SharedHandle handle_;
};

/// The wait of Publisher::publish() for a hub that takes too little, if nobody says otherwise: a
/// loop that steers something must not stand still for longer, and its message is old by then.
inline constexpr Timeout kPublishTimeout{1000};

/// The answer of Publisher::publish(), which may be ignored: what could not be sent is old by the
/// next time.
class Published : public Outcome<void> {
 public:
  Published(Outcome<void> outcome) : Outcome<void>(std::move(outcome)) {}
};

/// Memory of the library for a message that is to be published (Publisher::loan()), aligned to 64.
/// Thread safety: a value that can be moved; one thread at a time.
class Loan {
 public:
  /// Takes over what the library gave out.
  explicit Loan(const gimi_loaned& loan) : loan_(loan) {}
  Loan(Loan&& other) noexcept : loan_(std::exchange(other.loan_, {})) {}
  Loan& operator=(Loan&& other) noexcept {
    std::swap(loan_, other.loan_);
    return *this;
  }
  Loan(const Loan&) = delete;
  Loan& operator=(const Loan&) = delete;
  ~Loan() { gimi_loan_release(&loan_); }

  /// Valid until: this loan is published, moved from or destroyed.
  [[nodiscard]] std::span<std::byte> data() const {
    return {static_cast<std::byte*>(loan_.data), loan_.size};
  }
  /// Fewer bytes are published. REQUIRES: size <= data().size().
  void shrink(std::size_t size) { loan_.size = size; }

 private:
  friend class Publisher;
  gimi_loaned loan_;
};

/// An own service that provides data. Copies are the same service; with the last one it ends, which
/// asks the hub and waits for its answer, a second at most.
class Publisher {
 public:
  /// Sends 0 bytes to 1 GiB to all subscribers; slow ones are not waited for. Without subscribers
  /// nothing leaves the process, but of a retained service. Waits while the own send queue is full
  /// and while another thread publishes. While the hub is away the message is dropped at once, also
  /// one to be retained: not_connected. Other errors: timeout (not sent; subscribers may count it
  /// as missed), not_retained (sent, but too large to be kept), refused (the hub did not take the
  /// service again), too_large, closed.
  Published publish(BytesView data, Timeout timeout = kPublishTimeout, More more = More::no) const {
    return detail::outcome_of(gimi_publish(handle_.value(), data.data(), data.size(),
                                           milliseconds_of(timeout), more == More::yes ? 1 : 0));
  }
  Published publish(BytesView data, More more) const {
    return publish(data, kPublishTimeout, more);
  }
  /// Memory for a message of so many bytes, which the program fills in place. Errors: too_large
  /// (over 1 GiB), system (no memory), closed.
  Outcome<Loan> loan(std::size_t size) const {
    gimi_loaned loan{};
    const gimi_status status = gimi_loan(handle_.value(), size, &loan);
    if (status != GIMI_OK) return failure_of(status);
    return Loan(loan);
  }
  /// publish() of a loan. One that was sent is empty then; one that was not goes on as it is.
  Published publish(Loan& loan, Timeout timeout = kPublishTimeout, More more = More::no) const {
    return detail::outcome_of(gimi_publish_loan(
        handle_.value(), &loan.loan_, milliseconds_of(timeout), more == More::yes ? 1 : 0));
  }
  /// Their number, as the hub told last.
  [[nodiscard]] std::size_t subscribers() const { return gimi_subscribers(handle_.value()); }
  /// Waits until there are that many. Errors: timeout, closed.
  Outcome<void> wait_for_subscribers(std::size_t count, Timeout timeout = kForever) const {
    return detail::outcome_of(
        gimi_wait_for_subscribers(handle_.value(), count, milliseconds_of(timeout)));
  }
  /// Waits until their number is another one than this told last, and tells it; the first call does
  /// not wait. A camera that nobody watches rests in it. Errors: timeout, closed.
  Outcome<std::size_t> subscribers_changed(Timeout timeout = kForever) const {
    std::size_t count = 0;
    const gimi_status status =
        gimi_subscribers_changed(handle_.value(), milliseconds_of(timeout), &count);
    if (status != GIMI_OK) return failure_of(status);
    return count;
  }
  /// In full, as it is now: another one after Node::take_name().
  [[nodiscard]] std::string name() const { return detail::service_name(handle_.value()); }
  /// Messages that publish() sent.
  [[nodiscard]] std::uint64_t published() const { return gimi_published(handle_.value()); }
  /// Messages that publish() dropped, since the hub was away.
  [[nodiscard]] std::uint64_t unsent() const { return gimi_unsent(handle_.value()); }
  /// Does the hub keep the last message for later subscribers? Ok until it says no, a moment after
  /// publish(). Errors: not_retained (why), closed.
  [[nodiscard]] Outcome<void> retained() const {
    return detail::outcome_of(gimi_retained(handle_.value()));
  }
  /// Does the hub have the service, or will it be offered with the next connection? Errors: why it
  /// did not take it again after a break or another name, with its words (limit and others; it is
  /// asked again after the next break); closed.
  [[nodiscard]] Outcome<void> standing() const {
    return detail::outcome_of(gimi_standing(handle_.value()));
  }

  /// For the C functions, and for a WaitSet, which waits for what subscribers_changed() tells.
  [[nodiscard]] gimi_handle c_handle() const { return handle_.value(); }

  /// Made by Node.
  explicit Publisher(detail::SharedHandle handle) : handle_(std::move(handle)) {}

 private:
  detail::SharedHandle handle_;
};

/// A subscription to somebody's service. It survives that the provider ends and comes back. Copies
/// are the same subscription; with the last one it ends, as a Publisher does.
class Subscription {
 public:
  /// As Queue::receive() and Queue::try_receive(). Errors also: silence
  /// (SubscribeOptions::silence).
  Outcome<Message> receive(Timeout timeout = kForever) const {
    return detail::receive(handle_.value(), timeout);
  }
  [[nodiscard]] std::optional<Message> try_receive() const {
    return detail::try_receive(handle_.value());
  }
  /// The queue of its messages. The subscription lasts as long as this queue is held.
  [[nodiscard]] Queue queue() const { return Queue(handle_); }
  /// Is there a provider at the moment?
  [[nodiscard]] bool exists() const { return provider() == GIMI_PROVIDES; }
  /// Is there one who takes data under that name instead? Nothing will come from it; send to it.
  [[nodiscard]] bool accepts() const { return provider() == GIMI_ACCEPTS; }
  /// Waits until there is. Errors: timeout, closed.
  Outcome<void> wait_until_exists(Timeout timeout = kForever) const {
    return detail::outcome_of(gimi_wait_until_exists(handle_.value(), milliseconds_of(timeout)));
  }
  /// In full.
  [[nodiscard]] std::string name() const { return detail::service_name(handle_.value()); }
  /// Messages that this program does not get: those that did not come, by their sequence, and those
  /// that the queue overwrote. Of Delivery::latest they were skipped for newer ones. One that comes
  /// late, behind at most 63 younger ones, is taken off again.
  [[nodiscard]] std::uint64_t missed() const { return detail::counts(handle_.value()).missed; }
  /// As Publisher::standing(), of the subscription; with or without a provider.
  [[nodiscard]] Outcome<void> standing() const {
    return detail::outcome_of(gimi_standing(handle_.value()));
  }

  /// For the C functions, and for a WaitSet.
  [[nodiscard]] gimi_handle c_handle() const { return handle_.value(); }

  /// Made by Node.
  explicit Subscription(detail::SharedHandle handle) : handle_(std::move(handle)) {}

 private:
  [[nodiscard]] gimi_direction provider() const {
    gimi_direction provider = GIMI_NOBODY;
    static_cast<void>(gimi_provider(handle_.value(), &provider));
    return provider;
  }
  detail::SharedHandle handle_;
};

}  // namespace gimnet::inline GIMNET_GIMI_NAMESPACE
