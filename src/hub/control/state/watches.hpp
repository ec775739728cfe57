#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "hub/control/state/journal.hpp"
#include "hub/control/state/membership.hpp"
#include "hub/control/state/records.hpp"
#include "proto/control/pattern.hpp"

namespace gimnet::hub {

/// The watches of names and services, and how far each has been told. A watch is a place in the
/// journal. A watch that fell off the journal's end is told the present state from the start again.
/// Each serve() does a bounded piece of work, for one node after the other. Thread safety: none.
/// Time is an argument. Limits: watches, watches_per_node, scan_records, watch_event_bytes,
/// watch_window, watch_window_per_node.
class Watches {
 public:
  Watches(HubTitle hub, std::uint64_t epoch, const Limits& limits);

  /// Keeps what the effect says for those who watch. REQUIRES: the effects before it were noted.
  void note(const NodeNoted& noted, const Membership& membership, std::chrono::milliseconds now);
  void note(const ServiceNoted& noted, const Membership& membership, std::chrono::milliseconds now);
  /// The network of hubs has these names from now on: they are told of, too. Lifetime: they outlive
  /// this.
  void join_network(const NameCopies& names) { names_ = &names; }
  void note(const NameChange& noted);
  /// The names of a whole hub went: everybody is told the present state anew.
  void begin_again() { journal_.begin_again(); }

  /// Begins a watch, or one of that number anew. Errors: bad_request, limit.
  [[nodiscard]] Result<proto::ns::WatchAnswer, proto::Refusal> watch(
      NodeIndex node, const proto::ns::Watch& wanted);
  /// Errors: not_found. nullopt: done.
  [[nodiscard]] std::optional<proto::Refusal> unwatch(NodeIndex node, std::uint32_t number);
  /// The node took so many WATCH_EVENTS of a watch: it may have as many more.
  void taken(NodeIndex node, const proto::ns::WatchTaken& taken);
  /// The node may not have got what it was sent: each of its watches begins again.
  void start_over(NodeIndex node);
  /// The node's connection ended, and its watches with it.
  void connection_ended(NodeIndex node);

  /// Gives `send` what is due, a piece of it. True: there is more to do at once.
  using Send = std::function<void(NodeIndex node, proto::Payload events)>;
  [[nodiscard]] bool serve(const Membership& membership, std::chrono::milliseconds now,
                           const Send& send);

  [[nodiscard]] const Journal& journal() const { return journal_; }
  [[nodiscard]] std::size_t size() const { return watches_; }
  /// Counts the times that a watch was so far behind that it had to begin again.
  [[nodiscard]] std::uint64_t resyncs() const { return resyncs_; }

 private:
  /// The part that a watch is told now: the snapshot's nodes, its services, or changes alone.
  enum class Phase : std::uint8_t { begin, nodes, services, end, live };
  struct Watch {
    std::uint32_t number = 0;
    std::uint8_t subjects = proto::ns::kWatchAll;
    std::optional<proto::Pattern> pattern;  ///< nothing: all
    Phase phase = Phase::begin;
    NodeId last_node;           ///< that the snapshot looked at
    GroupId last_group;         ///< the same of services
    bool few = true;            ///< may what the snapshot is about be found by name?
    std::uint64_t seen = 0;     ///< version up to which changes were looked at
    std::size_t under_way = 0;  ///< WATCH_EVENTS that were not taken yet
    std::uint64_t told = 0;     ///< version of the last events
  };
  struct Watcher {
    std::vector<Watch> watches;
    std::size_t next = 0;       ///< whose turn it is
    std::size_t under_way = 0;  ///< of all its watches
  };
  /// One WATCH_EVENTS that is being written.
  struct Page {
    std::vector<std::byte> bytes;
    bool full = false;
    [[nodiscard]] bool empty() const { return bytes.empty(); }
  };
  struct Turn {
    const Membership& membership;
    std::chrono::milliseconds now;
    std::size_t work;  ///< records and changes that may yet be looked at
  };

  [[nodiscard]] bool serve_one(NodeIndex node, Watcher& watcher, Turn& turn, const Send& send);
  [[nodiscard]] bool is_idle(const Watcher& watcher, const Watch& watch) const;
  [[nodiscard]] bool is_full(const Page& page) const;
  void begin(Watch& watch);
  [[nodiscard]] Page next_page(Watch& watch, Turn& turn);
  void add_changes(Watch& watch, Page& page, Turn& turn) const;
  void add_nodes(Watch& watch, Page& page, Turn& turn) const;
  void add_services(Watch& watch, Page& page, Turn& turn) const;
  /// By id, own ones among those of other hubs.
  template <class Id, class Own, class Behind, class Add>
  void add_by_id(Watch& watch, Page& page, Turn& turn, Id& last, const Own& all, Behind behind,
                 Add add_own) const;
  /// By name, where those whose names begin as the pattern does are few. False: they are not, and
  /// nothing was added.
  [[nodiscard]] bool add_few(Watch& watch, Page& page, Turn& turn) const;
  /// Calls `add` with each index of the list until the page is full. False: there is no list.
  template <class List, class Add>
  [[nodiscard]] static bool add_listed(Watch& watch, Page& page, Turn& turn,
                                       const std::optional<List>& listed, Add add);
  void add_node(const Session& session, Page& page, const Turn& turn) const;
  void add_service(const Topic& topic, Page& page) const;
  /// A node or a service of another hub.
  void add_other(const KnownName& known, Page& page) const;
  /// Moves the snapshot on, behind the nodes or the services.
  static void next_phase(Watch& watch);
  void add_mark(proto::ns::ChangeKind kind, Page& page) const;
  void add(const proto::ns::Change& change, Page& page) const;
  [[nodiscard]] proto::Payload finish(Watch& watch, Page page) const;
  [[nodiscard]] static bool wants(const Watch& watch, const Journal::Note& note);
  [[nodiscard]] static bool fits(const Watch& watch, std::string_view name);

  const HubTitle hub_;
  const Limits& limits_;
  Journal journal_;
  const NameCopies* names_ = nullptr;  ///< or none: a hub that has had no link yet
  std::map<NodeIndex, Watcher> watchers_;
  NodeIndex last_served_;
  std::size_t watches_ = 0;
  std::uint64_t resyncs_ = 0;
};

}  // namespace gimnet::hub
