#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "proto/control/link.hpp"
#include "proto/control/ns.hpp"
#include "proto/frame/frame_header.hpp"
#include "tests/sim/checker.hpp"
#include "tests/sim/network.hpp"
#include "tests/sim/watch_view.hpp"

namespace gimnet::sim {

/// A simulated node: it dials, joins, asks, sends, breaks and comes back as the seed says, and
/// checks what it is told. Thread safety: none. Errors: Broken.
class SimNode {
 public:
  /// The parts of the world that it needs.
  struct Around {
    Setting& setting;
    Network& network;
    std::function<void(const WirePointer&, const proto::Hello&, const hub::Identity& identity)>
        say_hello;
    std::function<void(const WirePointer&, bool mute)> set_mute;
  };
  SimNode(const Around& around, std::uint32_t number);

  /// Begins to act, now or soon.
  void start();
  /// Has the hub drained, if it is an administrator and can ask.
  [[nodiscard]] bool order_drain();
  void hears(const WirePointer& wire, const Bytes& frame);
  void sees_the_end(const WirePointer& wire);

  [[nodiscard]] std::uint32_t number() const { return number_; }
  [[nodiscard]] bool is_slow() const { return slow_; }
  [[nodiscard]] const hub::Identity& identity() const { return identity_; }
  [[nodiscard]] bool is_up() const { return wire_ != nullptr && link().welcomed; }
  [[nodiscard]] bool waits_for_answers() const { return wire_ != nullptr && !link().open.empty(); }
  /// Why the hub did not let it in last.
  [[nodiscard]] proto::GoodbyeCode refusal() const { return refusal_; }
  [[nodiscard]] NodeId id() const { return id_; }
  [[nodiscard]] const std::string& name() const { return registered_; }
  struct Provided {
    proto::ns::Advertise offer;
    GroupId group;
  };
  [[nodiscard]] const std::map<std::string, Provided>& provides() const {
    return provides_;
  }  ///< by service
  /// The place of a service.
  struct Known {
    GroupId group;    ///< 0: none
    NodeId provider;  ///< 0: nobody
    friend bool operator==(const Known&, const Known&) = default;
  };
  struct Subscribed {
    proto::ns::Subscribe wanted;
    Known known;
  };
  [[nodiscard]] const std::map<std::string, Subscribed>& subscribes() const {
    return subscribes_;
  }  ///< by full name
  /// The view that it has by watching; nullptr if it does not watch.
  [[nodiscard]] const WatchView* view() const { return watches_ ? &view_ : nullptr; }

 private:
  /// A request that is not answered yet.
  struct Open {
    proto::Kind kind{};
    std::uint16_t operation = 0;
    std::string subject;
    proto::ns::Advertise offer;
    proto::ns::Subscribe wanted;
    GroupId group{};  ///< of a WITHDRAW
  };
  [[nodiscard]] static Open about(std::string subject, proto::ns::Advertise offer = {}) {
    return {{}, 0, std::move(subject), std::move(offer), {}, {}};
  }
  /// The messages of a group that came by one connection.
  struct Taken {
    std::optional<std::uint8_t> number;  ///< of the counts; nothing: none begun
    std::uint64_t messages = 0;
    std::uint64_t credited = 0;
    std::uint64_t last = 0;           ///< number of the last message
    std::uint32_t window = 0;         ///< in force; 0: none, or not known yet
    std::uint32_t window_most = 0;    ///< that may have been in force; 0: not known
    std::uint64_t before_window = 0;  ///< messages up to that one may have gone without a window
    bool retained = false;
    bool credit_due = false;
  };
  /// The state of one connection.
  struct Link {
    WirePointer wire;
    bool welcomed = false;
    std::optional<proto::GoodbyeCode> told;  ///< how the hub ended it
    NodeId id;
    std::map<std::uint16_t, Open> open;    ///< by request number
    std::map<std::uint32_t, Taken> taken;  ///< by group
    std::set<std::uint32_t> gone;  ///< groups that ended: what still comes of them counts no more
    std::map<std::string, Known> moved;  ///< by events of this connection
    std::map<std::string, Known>
        before;  ///< of those that it declares again: where it knew them to be
    bool same_session =
        false;  ///< as its last connection, and no other was dialled in vain between
    Time dialled{};
    std::uint16_t last_request = 0;
  };
  [[nodiscard]] Link& link() { return links_.at(wire_->number); }
  [[nodiscard]] const Link& link() const { return links_.at(wire_->number); }
  [[nodiscard]] bool faulty() const;

  void act_later();
  void act();
  void dial();
  [[nodiscard]] proto::Hello hello(hub::Identity& identity);
  void spoil_token(proto::Hello& hello, hub::Identity& identity);
  bool break_something();
  void fall(bool unseen);
  void hang();
  void say_goodbye();
  void misbehave();
  void flood();
  void lose_connection();
  void give_up_others();
  void forget_life();

  void ask_something();
  void ask_about_names(std::uint64_t choice);
  void change_services(std::uint64_t choice);
  void advertise(const std::string& service, bool anew);
  void draw_delivery(proto::ns::Advertise& offer);
  [[nodiscard]] proto::ns::Subscribe some_subscription(const std::string& full_name);
  void subscribe(const proto::ns::Subscribe& wanted);
  void send_something();
  void send_message(proto::Kind kind, std::uint32_t dst,
                    proto::Policy policy = proto::Policy::kind_default);
  void publish(const Provided& service);
  void tell_others(const std::string& full_name);
  [[nodiscard]] std::string some_service(std::uint64_t number);
  void declare_again();
  void watch_or_rename(std::uint64_t choice);
  void watch();
  void administer();
  void say_taken();
  void on_own_name(const Open& asked, std::span<const std::byte> payload);
  void on_watch_events(std::span<const std::byte> payload);
  template <class Message>
  void ask(const Message& message, Open open, proto::Kind kind = proto::Kind::ns) {
    Link& to = link();
    if (++to.last_request == proto::kNoRequest) ++to.last_request;
    open.operation = Message::kOperation;
    ask_raw(kind, proto::encode(message, to.last_request), std::move(open));
  }
  void ask_raw(proto::Kind kind, const proto::Payload& payload, Open open);
  void send(proto::Kind kind, std::uint32_t dst, std::span<const std::byte> payload,
            std::uint8_t flags = 0);

  void on_link(const WirePointer& wire, std::span<const std::byte> payload);
  void on_welcome(const WirePointer& wire, const proto::Welcome& welcome);
  void on_control(Link& from, std::span<const std::byte> payload);
  void on_answer(const Open& asked, std::span<const std::byte> payload);
  void on_event(Link& from, std::uint16_t operation, std::span<const std::byte> payload);
  void on_data(Link& from, const proto::FrameHeader& header, const Bytes& frame);
  void on_service_moved(Link& from, std::span<const std::byte> payload);
  void require_told(const Link& from, const std::string& full_name, const Known& known) const;
  /// It may have subscribed to something on that connection and not know it.
  [[nodiscard]] static bool subscribes_now(const Link& link);
  void on_subscribed(const Open& asked, const proto::ns::SubscribeAnswer& answer);
  void know_window(Link& link, const std::string& full_name, const proto::ns::ServiceState& state,
                   std::uint8_t number);
  void take_message(Link& from, GroupId group, std::uint64_t message);
  void credit(Link& from, GroupId group);
  void credit_later(Link& from, GroupId group);
  void learn(NodeId node);
  [[nodiscard]] std::string some_name();
  [[nodiscard]] std::string some_pattern(bool of_services);

  const Around around_;
  const std::uint32_t number_;
  std::string wish_;  ///< the name; "" for a node without one
  bool slow_ = false;
  bool resumes_ = false;
  bool administers_ = false;
  hub::Identity identity_;  ///< as the system tells the hub
  // Of its session
  std::vector<std::byte> token_;
  std::vector<std::byte> old_token_;  ///< of a session before
  NodeId id_;
  bool was_kicked_ = false;
  std::string registered_;  ///< the name that it has
  std::map<std::string, Provided> provides_;
  std::map<std::string, Subscribed> subscribes_;
  std::set<std::string> unsubscribing_;  ///< asked to, not answered: the hub may have ended it
  std::map<std::string, std::set<std::uint32_t>> windows_asked_;  ///< ever, by full name
  std::uint8_t next_number_ = 0;                                  ///< of counts
  std::uint64_t session_ = 0;  ///< the latest, by the reference model
  std::uint64_t dials_ = 0;    ///< since its last WELCOME
  // Of its connection
  WirePointer wire_;
  std::map<std::uint64_t, Link> links_;  ///< by wire; those that it replaced itself, too
  bool hung_ = false;
  std::vector<std::pair<WirePointer, Bytes>> unheard_;  ///< came while it hung
  proto::GoodbyeCode refusal_{};
  Time not_before_{};          ///< it does not dial earlier
  std::vector<NodeId> known_;  ///< others that it has heard of
  std::set<std::uint32_t> known_groups_;
  WatchView view_;
  bool watches_ = false;       ///< the hub has granted it, on this connection
  bool wants_watch_ = false;   ///< asked for it, and will again on the next one
  std::uint32_t untaken_ = 0;  ///< WATCH_EVENTS that it has not said to have taken
  bool forgot_ = false;  ///< what it had subscribed to: the hub may send what it does not know
};

}  // namespace gimnet::sim
