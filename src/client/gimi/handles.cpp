#include <array>

#include "client/gimi/core.hpp"
#include "client/gimi/home.hpp"
#include "client/gimi/watch_table.hpp"
#include "gimnet/gimi.hpp"
#include "gimnet/gimi/outcome.hpp"

namespace gimnet {

std::string_view status_text(Status status) {
  switch (status) {
    case Status::timeout:
      return "timeout";
    case Status::closed:
      return "closed";
    case Status::bad_argument:
      return "bad argument";
    case Status::no_hub:
      return "no hub";
    case Status::no_host:
      return "unknown host";
    case Status::not_connected:
      return "not connected";
    case Status::bad_version:
      return "bad version";
    case Status::name_taken:
      return "name taken";
    case Status::bad_name:
      return "bad name";
    case Status::refused:
      return "refused";
    case Status::not_found:
      return "not found";
    case Status::taken:
      return "taken";
    case Status::denied:
      return "denied";
    case Status::limit:
      return "limit reached";
    case Status::too_large:
      return "too large";
    case Status::not_delivered:
      return "not delivered";
    case Status::window_full:
      return "window full";
    case Status::protocol:
      return "protocol error";
    case Status::system:
      return "system error";
    case Status::forked:
      return "forked";
    case Status::not_retained:
      return "not retained";
  }
  return "unknown status";
}

// The handles of gimnet/gimi.hpp: each leads to its part of a Core, which it keeps alive.

using gimi::at_home;

Outcome<Message> Queue::receive(Timeout timeout) const {
  return at_home(queue_->inbox().home(), [&] { return queue_->inbox().receive(*queue_, timeout); });
}
std::optional<Message> Queue::try_receive() const {
  return at_home(queue_->inbox().home(), [&] { return queue_->inbox().try_receive(*queue_); });
}
std::optional<Message> Queue::take_newest() const {
  return at_home(queue_->inbox().home(), [&] { return queue_->inbox().take_newest(*queue_); });
}
void Queue::resize(std::size_t messages) const {
  if (!queue_->inbox().home().left()) queue_->inbox().resize(*queue_, messages);
}
std::size_t Queue::size() const {
  return at_home(queue_->inbox().home(), [&] { return queue_->inbox().counts(*queue_).size; });
}
std::uint64_t Queue::received() const {
  return at_home(queue_->inbox().home(), [&] { return queue_->inbox().counts(*queue_).received; });
}
std::uint64_t Queue::overwritten() const {
  return at_home(queue_->inbox().home(),
                 [&] { return queue_->inbox().counts(*queue_).overwritten; });
}

Outcome<void> Sender::send(BytesView data, Timeout timeout, More more) const {
  return at_home(stream_->home(), [&] { return stream_->send(data, timeout, more); });
}
Outcome<void> Sender::settle(Timeout timeout) const {
  return at_home(stream_->home(), [&] { return stream_->settle(timeout); });
}
SendCounts Sender::counts() const {
  return at_home(stream_->home(), [&] { return stream_->counts(); });
}
Peer Sender::peer() const { return stream_->to(); }
const std::string& Sender::service() const { return stream_->service(); }

Outcome<void> Publisher::publish(BytesView data, Timeout timeout, More more) const {
  return at_home(service_->home(), [&] { return service_->publish(data, timeout, more); });
}
std::size_t Publisher::subscribers() const {
  return at_home(service_->home(), [&] { return service_->subscribers(); });
}
Outcome<void> Publisher::wait_for_subscribers(std::size_t count, Timeout timeout) const {
  return at_home(service_->home(), [&] { return service_->wait_for_subscribers(count, timeout); });
}
std::string Publisher::name() const {
  return at_home(service_->home(), [&] { return service_->full_name(); });
}
std::uint64_t Publisher::published() const {
  return at_home(service_->home(), [&] { return service_->published(); });
}
Outcome<void> Publisher::retained() const {
  return at_home(service_->home(), [&] { return service_->retained(); });
}
Outcome<void> Publisher::standing() const {
  return at_home(service_->home(), [&] { return service_->standing(); });
}

Outcome<Message> Subscription::receive(Timeout timeout) const {
  gimi::MessageQueue& queue = service_->queue();
  return at_home(queue.inbox().home(), [&] { return queue.inbox().receive(queue, timeout); });
}
std::optional<Message> Subscription::try_receive() const {
  gimi::MessageQueue& queue = service_->queue();
  return at_home(queue.inbox().home(), [&] { return queue.inbox().try_receive(queue); });
}
Queue Subscription::queue() const { return Queue({service_, &service_->queue()}); }
bool Subscription::exists() const {
  return at_home(service_->home(), [&] { return service_->exists(); });
}
bool Subscription::accepts() const {
  return at_home(service_->home(), [&] { return service_->accepts(); });
}
Outcome<void> Subscription::wait_until_exists(Timeout timeout) const {
  return at_home(service_->home(), [&] { return service_->wait_until_exists(timeout); });
}
const std::string& Subscription::name() const { return service_->name(); }
std::uint64_t Subscription::missed() const {
  return at_home(service_->home(), [&] { return service_->missed(); });
}
Outcome<void> Subscription::standing() const {
  return at_home(service_->home(), [&] { return service_->standing(); });
}

Outcome<WatchEvent> Watch::receive(Timeout timeout) const {
  return at_home(queue_->home(), [&] { return queue_->receive(timeout); });
}
std::optional<WatchEvent> Watch::try_receive() const {
  return at_home(queue_->home(), [&] { return queue_->try_receive(); });
}

std::string_view change_text(Change change) {
  static constexpr std::array<std::string_view, 11> kTexts{
      "snapshot begins", "present", "snapshot ends", "joined",   "left", "away", "back",
      "renamed",         "changed", "advertised",    "withdrawn"};
  const auto index = static_cast<std::size_t>(change);
  if (change == Change::ended) return "ended";
  return index < kTexts.size() ? kTexts[index] : "unknown";
}

}  // namespace gimnet
