#pragma once

#include <atomic>
#include <cstdint>
#include <span>
#include <utility>

#include "client/nif/credit_book.hpp"
#include "client/nif/declarations.hpp"
#include "client/nif/event_record.hpp"
#include "client/nif/hub_clock.hpp"
#include "client/nif/name_cache.hpp"
#include "client/nif/node_status.hpp"
#include "client/nif/options.hpp"
#include "client/nif/outbound.hpp"
#include "client/nif/receive_queue.hpp"
#include "client/nif/request_table.hpp"
#include "client/nif/watch_table.hpp"

namespace gimnet::nif {

/// The parts of a node that its library thread and the program's threads share. Thread safety: as
/// each part says.
struct NodeParts {
  explicit NodeParts(Options given)
      : options(std::move(given)),
        outbound(options.send, wake, options.last_message_bytes),
        received(options.receive_queue_bytes, wake),
        requests(outbound),
        credits(outbound),
        declarations(requests, outbound, credits),
        watches(requests) {}

  void push_event(Record* event) {
    event->incoming.arrival_ns = wall_now_ns();
    const Item item = item_of(event, event->text.size());
    received.push(std::span(&item, 1));
  }

  const Options options;
  net::WakeSignal wake;  ///< there is work for the library's thread
  net::WakeSignal stop;  ///< ends a dial
  Outbound outbound;
  ReceiveQueue received;
  RequestTable requests;
  CreditBook credits;
  Declarations declarations;
  WatchTable watches;
  NameCache names;
  HubClock clock;
  NodeStatus record;
  std::atomic<std::uint32_t> id{0};
  std::atomic<bool> closing{false};
};

}  // namespace gimnet::nif
