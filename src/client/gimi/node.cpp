#include <algorithm>
#include <utility>

#include "base/check.hpp"
#include "client/gimi/core.hpp"
#include "client/gimi/ending.hpp"
#include "client/gimi/hub_records.hpp"
#include "gimnet/gimi.hpp"

namespace gimnet {
namespace {

using gimi::at_home;
using gimi::failure_of;
using gimi::nif_timeout;

NodeOptions options_of(std::string_view name, std::string_view hub) {
  NodeOptions options;
  options.name = name;
  options.hub = hub;
  return options;
}

/// A stream that a Sender holds: while it is held, the table does not end the stream, and the node
/// does not end its parts.
std::shared_ptr<gimi::SendStream> owned(std::shared_ptr<gimi::Core> core,
                                        gimi::StreamTable::Stream stream) {
  gimi::SendStream* const raw = stream.get();
  return {raw, [core = std::move(core), stream = std::move(stream)](gimi::SendStream*) mutable {
            stream.reset();
            core.reset();
          }};
}

}  // namespace

Node::Node(std::string_view name, std::string_view hub)
    : core_(gimi::Core::join(options_of(name, hub)).or_throw()) {}

Outcome<Node> Node::join(const NodeOptions& options) {
  auto core = gimi::Core::join(options);
  if (!core) return core.failure();
  return Node(std::move(*core));
}

Node::Node(Node&&) noexcept = default;
Node& Node::operator=(Node&& other) noexcept {
  if (core_ && core_ != other.core_) core_->close();
  core_ = std::move(other.core_);
  return *this;
}
Node::~Node() { close(); }

void Node::close() {
  if (core_) core_->close();
}

gimi::Core& Node::core() const {
  GIMNET_CHECK(core_ != nullptr);
  return *core_;
}

Peer Node::peer() const { return Peer{nif_id(core().node())}; }
NodeState Node::state() const {
  return at_home(core().home(), [&] { return core().state(); });
}

Outcome<Sender> Node::sender(Peer to, const SendOptions& options) const {
  auto stream = at_home(core().home(), [&] { return core().streams().stream(to, options); });
  if (!stream) return stream.failure();
  return Sender(owned(core_, *stream));
}

Outcome<Sender> Node::sender(std::string_view to, const SendOptions& options,
                             Timeout timeout) const {
  const auto peer = find(to, timeout);
  if (!peer) return peer.failure();
  return sender(*peer, options);
}

Outcome<Sender> Node::sender_to_service(std::string_view full_name, const SendOptions& options,
                                        Timeout timeout) const {
  const auto found = services(full_name, timeout);
  if (!found) return found.failure();
  const std::string name(full_name);
  // The listing takes patterns, too: only the service of that very name counts.
  const auto service = std::ranges::find(*found, name, &ServiceRecord::name);
  if (service == found->end()) {
    return Failure{Status::not_found,
                   "cannot send to '" + name +
                       "': there is no such service at the moment; watch() tells when there is"};
  }
  if (service->direction != Direction::accepts) {
    return Failure{Status::not_found,
                   "cannot send to '" + name + "': it gives data and takes none; subscribe to it"};
  }
  gimi::StreamTable& streams = core().streams();
  if (const auto ended = streams.make_place(name))
    core().services().unfollow(*ended, [&] { return streams.has_service(*ended); });
  auto stream = core().services().follow(name, timeout, [&](const gimi::ServicePlace& place) {
    return streams.service_stream(name, place, options);
  });
  if (!stream) return stream.failure();
  return Sender(owned(core_, *stream));
}

Outcome<void> Node::send(Peer to, BytesView data, const SendOptions& options,
                         Timeout timeout) const {
  const auto stream = sender(to, options);
  if (!stream) return stream.failure();
  return stream->send(data, timeout);
}

Outcome<void> Node::send(std::string_view to, BytesView data, const SendOptions& options,
                         Timeout timeout) const {
  const auto stream = sender(to, options, timeout);
  if (!stream) return stream.failure();
  return stream->send(data, timeout);
}

Outcome<void> Node::flush() const {
  const nif_status status = nif_flush(core().node());
  if (status != NIF_OK) return failure_of(status, "write what was held back");
  return {};
}

Outcome<void> Node::drain(Timeout timeout) const {
  const nif_status status = nif_drain(core().node(), nif_timeout(timeout));
  if (status != NIF_OK) return failure_of(status, "write what waits");
  return {};
}

Queue Node::queue(MessageKey key, const QueueOptions& options) const {
  gimi::Inbox& inbox = core().inbox();
  return Queue({core_, inbox.home().left() ? &inbox.empty_queue() : &inbox.queue(key, &options)});
}

Outcome<Message> Node::receive(MessageKey key, Timeout timeout) const {
  return at_home(core().home(), [&] {
    return core().inbox().receive(core().inbox().queue(key, nullptr), timeout);
  });
}

Outcome<Message> Node::receive(Timeout timeout) const {
  return at_home(core().home(), [&] { return core().inbox().receive_any(timeout); });
}
std::uint64_t Node::dropped() const {
  return at_home(core().home(), [&] { return core().inbox().dropped(); });
}
LostCounts Node::lost() const {
  return at_home(core().home(), [&] { return core().lost(); });
}

Outcome<Publisher> Node::advertise(std::string_view name, const PublishOptions& options,
                                   Timeout timeout) const {
  auto service = at_home(core().home(), [&] {
    return core().services().advertise(core().state().name, std::string(name), options, timeout);
  });
  if (!service) return service.failure();
  return Publisher({*service, [core = core_](gimi::PublishedService* done) {
                      if (!core->home().left()) core->services().withdraw(*done);
                    }});
}

Outcome<Queue> Node::accept(std::string_view name, const AcceptOptions& options,
                            Timeout timeout) const {
  Queue made = queue(options.key, options.queue);
  auto accepted = at_home(core().home(), [&] {
    return core().services().accept(core().state().name, std::string(name), options, timeout);
  });
  if (!accepted) return accepted.failure();
  return made;
}

Outcome<Subscription> Node::subscribe(std::string_view full_name, const QueueOptions& options,
                                      Timeout timeout, const PaceOptions& pace) const {
  auto service = at_home(core().home(), [&] {
    return core().services().subscribe(std::string(full_name), options, pace, timeout);
  });
  if (!service) return service.failure();
  gimi::ServiceTable::Subscribed subscribed = *service;
  gimi::SubscribedService* const handle = subscribed.get();
  return Subscription(
      {handle, [core = core_, subscribed = std::move(subscribed)](gimi::SubscribedService*) {
         if (!core->home().left()) core->services().unsubscribe(subscribed);
       }});
}

Outcome<void> Node::take_name(std::string_view name, Timeout timeout) const {
  const std::string text(name);
  const nif_status status = nif_register(core().node(), text.c_str(), nif_timeout(timeout));
  if (status != NIF_OK) return failure_of(status, "take the name '" + text + "'");
  core().on_renamed();
  return {};
}

Outcome<void> Node::give_name_back(Timeout timeout) const {
  const nif_status status = nif_unregister(core().node(), nif_timeout(timeout));
  if (status != NIF_OK) return failure_of(status, "give the name back");
  core().on_renamed();
  return {};
}

Outcome<Watch> Node::watch(std::string_view pattern, const WatchOptions& options,
                           Timeout timeout) const {
  auto begun = at_home(core().home(), [&] {
    return core().watches().watch(std::string(pattern), options, timeout);
  });
  if (!begun) return begun.failure();
  return Watch({begun->queue.get(), [core = core_, begun = *begun](gimi::WatchQueue*) {
                  if (!core->home().left()) core->watches().unwatch(begun.number);
                }});
}

Outcome<Peer> Node::find(std::string_view name, Timeout timeout) const {
  if (const auto id = Peer::parse(name)) return *id;
  Peer peer;
  const std::string text(name);
  const nif_status status =
      nif_resolve(core().node(), text.c_str(), &peer.id, nif_timeout(timeout));
  if (status != NIF_OK) return failure_of(status, "find the node '" + text + "'");
  return peer;
}

Outcome<std::string> Node::name_of(Peer peer, Timeout timeout) const {
  std::string name(NIF_NAME_BYTES_MAX + 1, '\0');
  const nif_status status = nif_reverse(core().node(), peer.id, name.data(), nif_timeout(timeout));
  if (status != NIF_OK) return failure_of(status, "find the name of " + peer.text());
  name.resize(name.find('\0'));
  return name;
}

Outcome<std::vector<NodeRecord>> Node::nodes(std::string_view pattern, Timeout timeout) const {
  return gimi::list_nodes(core().node(), std::string(pattern), timeout);
}
Outcome<std::vector<ServiceRecord>> Node::services(std::string_view pattern,
                                                   Timeout timeout) const {
  return gimi::list_services(core().node(), std::string(pattern), timeout);
}
Outcome<HubRecord> Node::hub(Timeout timeout, std::uint32_t hub_id) const {
  return gimi::ask_hub({core().node(), hub_id}, timeout);
}
Outcome<std::vector<ShardCounts>> Node::hub_counters(Timeout timeout, std::uint32_t hub_id) const {
  return gimi::ask_counters({core().node(), hub_id}, timeout);
}
Outcome<std::vector<ConnectionRecord>> Node::hub_connections(Timeout timeout,
                                                             std::uint32_t hub_id) const {
  return gimi::ask_connections({core().node(), hub_id}, timeout);
}
Outcome<std::vector<NetworkHub>> Node::hubs(Timeout timeout, std::uint32_t hub_id) const {
  return gimi::ask_hubs({core().node(), hub_id}, timeout);
}
Outcome<std::vector<LinkRecord>> Node::hub_links(Timeout timeout, std::uint32_t hub_id) const {
  return gimi::ask_links({core().node(), hub_id}, timeout);
}
Outcome<void> Node::add_link(std::string_view url, std::string_view name, std::uint16_t cost,
                             Timeout timeout) const {
  return gimi::add_link(core().node(), {std::string(url), std::string(name), cost}, timeout);
}
Outcome<void> Node::remove_link(std::string_view name, Timeout timeout) const {
  return gimi::remove_link(core().node(), name, timeout);
}
Outcome<void> Node::set_link_cost(std::string_view name, std::uint16_t cost,
                                  Timeout timeout) const {
  return gimi::set_link_cost(core().node(), name, cost, timeout);
}

Outcome<std::string> Node::kick(Peer node, std::string_view reason, Timeout timeout) const {
  return gimi::kick(core().node(), node, reason, timeout);
}
Outcome<void> Node::reassign(Peer node, Peer new_id, Timeout timeout) const {
  return gimi::reassign(core().node(), node, new_id, timeout);
}
Outcome<void> Node::drain_hub(Timeout timeout) const {
  return gimi::drain_hub(core().node(), timeout);
}
Outcome<std::vector<HubChange>> Node::reload_hub(Timeout timeout) const {
  return gimi::reload_hub(core().node(), timeout);
}
Outcome<std::string> Node::set_hub_log_level(std::string_view level, Timeout timeout) const {
  return gimi::set_hub_log_level(core().node(), level, timeout);
}

Outcome<std::int64_t> Node::ping(Peer to, Timeout timeout, Lane lane, BytesView echo) const {
  if (gimi::is_every_node(to)) {
    return Failure{Status::bad_argument, to.text() + " cannot be pinged: this id means all nodes"};
  }
  const auto answer =
      at_home(core().home(), [&] { return core().ping(to, timeout, lane, echo, false); });
  if (!answer) return answer.failure();
  return answer->round_trip_ns;
}

Outcome<TracedPing> Node::trace(Peer to, Timeout timeout, Lane lane) const {
  return at_home(core().home(), [&] { return core().ping(to, timeout, lane, {}, true); });
}

}  // namespace gimnet
