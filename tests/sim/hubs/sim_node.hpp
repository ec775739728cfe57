#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "proto/control/control_message.hpp"
#include "proto/control/ns.hpp"
#include "proto/frame/flow.hpp"
#include "tests/sim/hubs/book.hpp"
#include "tests/sim/hubs/census.hpp"
#include "tests/sim/hubs/pictures.hpp"
#include "tests/sim/hubs/plan.hpp"
#include "tests/sim/hubs/sim_hub.hpp"

namespace gimnet::sim::hubs {

/// A program at one hub: it joins, comes back, asks, and sends to nodes of all hubs. It heeds
/// PAUSE. Thread safety: none.
class SimNode {
 public:
  struct Around {
    Random& random;
    Book& book;
    Census& census;
  };
  SimNode(const Around& around, const NodePlan& plan, bool administers)
      : around_(around), plan_(plan), administers_(administers), at_(plan.hub) {}

  /// `hub`: null while it does not run. `says_every`: ms between two messages, 0: it says nothing.
  void step(SimHub* hub, milliseconds now, std::uint64_t says_every);
  /// Its process ends, and comes back later with or without its memory.
  void crash(milliseconds now);
  /// Its connection breaks. It comes back after so long, with its token.
  void lose_connection(milliseconds now, std::uint64_t back_after_ms);
  /// It dials its other hub, and the one where it was hears nothing of it.
  void move(milliseconds now) { move_to(at_ == plan_.hub ? plan_.other : plan_.hub, now); }
  void move_to(std::size_t hub, milliseconds now);

  [[nodiscard]] bool is_up() const { return up_ && welcomed_; }
  [[nodiscard]] const NodePlan& plan() const { return plan_; }
  /// The hub at which it is, or which it dials.
  [[nodiscard]] std::size_t at() const { return at_; }
  [[nodiscard]] NodeId id() const { return id_; }
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const std::string& last() const { return last_; }
  /// Of the service with last message that it provides; nothing: it has none.
  [[nodiscard]] std::optional<GroupId> given() const { return given_; }
  [[nodiscard]] bool is_paused() const { return !paused_.empty(); }

  /// A frame with BLOCK; `bytes`: 8 at least, 0: a few. Returns its number; nothing: it was told to
  /// pause. REQUIRES: is_up().
  std::optional<std::uint64_t> send_to(NodeId to, std::uint64_t bytes = 0);
  /// Its hub has not read what it wrote.
  [[nodiscard]] bool is_blocked() const { return pipe_.transport_readable(); }
  /// Frames of other nodes that came.
  [[nodiscard]] std::uint64_t taken() const { return taken_; }
  /// To all nodes of all hubs.
  void broadcast(std::uint64_t number);
  /// The numbers that came.
  [[nodiscard]] const std::vector<std::uint64_t>& broadcasts() const { return broadcasts_; }
  /// A picture that replaces those which wait. REQUIRES: is_up().
  void show(NodeId to, std::uint32_t bytes);
  [[nodiscard]] const std::vector<Pictures::Seen>& pictures() const { return pictures_.seen(); }
  /// Its frames that were reported, of all reasons.
  [[nodiscard]] std::uint64_t reported() const { return reported_; }
  [[nodiscard]] std::optional<milliseconds> first_report(proto::DropReason reason) const {
    const auto found = first_report_.find(reason);
    return found == first_report_.end() ? std::nullopt : std::optional{found->second};
  }
  /// A message to the subscribers of its service. Returns its number. REQUIRES: given().
  std::uint64_t publish();
  /// To the service that a node of that name provides, if there is one.
  void subscribe(const std::string& node);
  /// Numbers of the messages of that group that came since it was asked for.
  [[nodiscard]] std::vector<std::uint64_t>& heard(GroupId group) { return heard_[group]; }
  /// It missed so many messages of that group in total.
  void say_missed(GroupId group, std::uint64_t total);
  void list_service(const std::string& node);
  /// To the service that a node of that name accepts: where it is, and whether it is away.
  void follow(const std::string& node);
  /// As its hub told last; null: it has not yet.
  [[nodiscard]] const proto::ns::ServiceState* followed(const std::string& node) const {
    const auto found = followed_.find(node + "/" + kTaken);
    return found == followed_.end() ? nullptr : &found->second;
  }
  /// It accepts a service, and has advertised it on this connection.
  [[nodiscard]] bool accepts() const { return accepts_; }
  /// The answers to list_service(): messages that subscribers at its hub missed, and the one that
  /// missed most.
  [[nodiscard]] std::pair<std::uint64_t, NodeId> missed(GroupId group) { return missed_[group]; }
  void ask(proto::Kind kind, const proto::Payload& payload, std::uint16_t request, HubId hub);
  void resolve(const std::string& name, HubId hub);
  template <class Message>
  void command(const Message& message) {
    ++last_request_;
    ask(proto::Kind::ctrl, proto::encode(message, last_request_), last_request_, {});
  }
  /// The answers to resolve(), by name: 0 if nobody holds it.
  [[nodiscard]] std::map<std::string, NodeId>& resolved() { return resolved_; }

 private:
  static constexpr const char* kTaken = "takes";
  struct Asked {
    milliseconds at;
    std::string name;       ///< that was to be resolved
    bool gives = false;     ///< ADVERTISE of a service with last message
    std::string follows{};  ///< SUBSCRIBE of that full name
  };
  void join(SimHub& hub, milliseconds now);
  void begin_session(NodeId id, bool new_session);
  void say();
  void ask_something();
  void offer();
  void give();
  void read(milliseconds now);
  void take(const proto::FrameHeader& header, std::span<const std::byte> payload);
  void say_flow(const proto::flow::Message& message);
  void take_flow(std::span<const std::byte> payload);
  void take_control(std::span<const std::byte> payload);
  void write(proto::Kind kind, std::uint32_t dst, std::span<const std::byte> payload,
             std::uint8_t flags = 0);
  std::optional<std::uint64_t> send(proto::Kind kind, std::uint32_t dst, std::uint64_t session,
                                    std::uint64_t bytes, proto::Policy policy);

  const Around around_;
  const NodePlan plan_;
  const bool administers_;
  std::size_t at_;
  std::string last_;  ///< how its last connection ended
  std::string goodbye_;
  bool up_ = false;
  bool welcomed_ = false;
  bool waits_ = false;  ///< until the hub that had it lets go of it
  hub::MemoryPeer pipe_;
  std::vector<std::byte> stream_;
  bool opened_ = false;
  NodeId id_;
  std::uint64_t session_ = 0;
  std::string name_;
  std::vector<std::byte> token_;
  std::optional<GroupId> group_;                             ///< of its service, which takes data
  bool accepts_ = false;                                     ///< since it joined
  std::map<std::string, proto::ns::ServiceState> followed_;  ///< by full name
  bool gives_ = false;  ///< it has a service with last message, each time that it joins
  std::optional<GroupId> given_;
  std::uint64_t published_ = 0;
  std::uint64_t taken_ = 0;
  std::vector<std::uint64_t> broadcasts_;
  Pictures pictures_;
  std::uint64_t reported_ = 0;
  std::map<proto::DropReason, milliseconds> first_report_;
  std::set<std::string> wanted_;  ///< full names of services
  std::map<GroupId, std::vector<std::uint64_t>> heard_;
  std::map<GroupId, std::pair<std::uint64_t, NodeId>> missed_;
  milliseconds now_{0};
  milliseconds back_at_{0};
  milliseconds say_at_{0};
  bool wants_name_ = true;
  std::uint16_t last_request_ = 0;
  std::map<std::uint16_t, Asked> asked_;
  std::map<std::string, NodeId> resolved_;
  /// By kind, lane and destination: until when. Nothing: until RESUME.
  std::map<std::tuple<proto::Kind, proto::Lane, std::uint32_t>, std::optional<milliseconds>>
      paused_;
};

}  // namespace gimnet::sim::hubs
