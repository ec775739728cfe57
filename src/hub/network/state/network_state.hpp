#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hub/network/state/link_cost.hpp"
#include "hub/network/state/network_map.hpp"
#include "hub/network/state/own_record.hpp"
#include "hub/network/state/record_store.hpp"

namespace gimnet::hub {

/// Bounds how often one link may bring a part of a record: 20 times a second each. Of those that
/// come faster the newest waits. An honest hub sends its own changes no faster, so this bounds what
/// one that is not can make all others do. Thread safety: none. Time is an argument. Limits:
/// remembers the parts that came within the last pause.
class PartPace {
 public:
  static constexpr std::chrono::milliseconds kPause{50};

  /// True: take it now. False: it waits, or a newer one does.
  [[nodiscard]] bool admit(const PartRef& part, std::chrono::milliseconds now) {
    const Part key{part->said.hub, part->said.part};
    const auto [found, is_new] = heard_.try_emplace(key);
    Heard& heard = found->second;
    if (is_new || (heard.waiting == nullptr && now >= heard.next)) {
      pause(key, heard, now);
      return true;
    }
    if (heard.waiting == nullptr) ++waiting_;
    if (heard.waiting == nullptr || is_newer(*part, *heard.waiting)) heard.waiting = part;
    return false;
  }

  /// The parts that waited long enough.
  [[nodiscard]] std::vector<PartRef> take_due(std::chrono::milliseconds now) {
    std::vector<PartRef> due;
    while (!pauses_.empty() && pauses_.front().until <= now) {
      const Pause over = pauses_.front();
      pauses_.pop_front();
      const auto entry = heard_.find(over.part);
      if (entry == heard_.end() || entry->second.next != over.until) continue;  // a later one began
      if (entry->second.waiting == nullptr) {
        heard_.erase(entry);
        continue;
      }
      due.push_back(std::exchange(entry->second.waiting, nullptr));
      --waiting_;
      pause(over.part, entry->second, now);
    }
    return due;
  }
  /// When to look for them: no later than one is due. Nothing: no part waits.
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_due() const {
    return waiting_ == 0 ? std::nullopt : std::optional{pauses_.front().until};
  }

 private:
  using Part = std::pair<proto::HubKey, std::uint16_t>;
  struct Heard {
    std::chrono::milliseconds next{};
    PartRef waiting;
  };
  struct Pause {
    std::chrono::milliseconds until{};
    Part part;
  };
  void pause(const Part& part, Heard& heard, std::chrono::milliseconds now) {
    heard.next = now + kPause;
    pauses_.push_back({heard.next, part});
  }

  std::map<Part, Heard> heard_;
  std::deque<Pause> pauses_;  ///< of all heard, in the order of time. Limit: 2 of each part
  std::size_t waiting_ = 0;   ///< parts
};

/// The far end of a link, and how the link came about.
struct LinkFacts {
  HubIdentity peer;
  std::string name;
  bool dialled = false;  ///< by this hub
  std::uint16_t cost = 1;
};

/// Whether a hub may become a neighbour, from the view of either end of a new link.
enum class LinkAdmission : std::uint8_t {
  accept,
  is_self,       ///< this process dialled itself
  is_copy,       ///< its state folder is a copy of one that another hub uses, perhaps this one
  ask_old_link,  ///< as is_copy, if the hub behind the link `old_link` still answers
  id_taken,      ///< another hub keeps its hub id
  draw_again,    ///< it keeps this hub's id: this hub draws another one, then it may try again
};
struct LinkAdmissionAnswer {
  LinkAdmission admission = LinkAdmission::accept;
  std::optional<proto::HubKey> holder{};  ///< id_taken, is_copy: the hub that is known
  LinkNumber old_link{};                  ///< ask_old_link
};

/// Whether this hub has to leave the network: to end all its links, tell its log, and try again.
enum class Verdict : std::uint8_t {
  stay,
  id_taken,  ///< another hub keeps this hub's id; a drawn id is drawn again
  copied,    ///< another machine runs a copy of this state folder
};

/// A payload of kind ROUTE for a link.
struct Sending {
  LinkNumber link;
  std::shared_ptr<const proto::Payload> bytes;
};

/// The routes of one hub: takes and floods the records of all hubs, says its own, and computes the
/// next hop to each. Pure state: what comes over links, and the time, are arguments, and what is to
/// be sent is taken out. After each call, or several at one time, advance() does what is due, and
/// take_sendings() gives what is to be sent, in order. Thread safety: none. Errors: bytes that are
/// no record are counted and otherwise ignored; calls for an unknown link are ignored, since a link
/// may have ended while they were under way. Limits: those of its parts.
class NetworkState {
 public:
  /// The next hops are computed at once, then at most so often for each begun mebibyte of records:
  /// computing takes a fraction of that pause, however many hubs are invented.
  static constexpr std::chrono::milliseconds kMapPause{50};
  /// Neighbours whose records differ for so long send them again: those of hubs that they can
  /// reach, which are the ones that they compare. The pauses double as long as it does not help.
  static constexpr ChangePace::Pauses kRepairPauses{std::chrono::seconds(1),
                                                    std::chrono::minutes(1)};
  /// Between two times that a link is named which brings more records than there is room for.
  static constexpr std::chrono::milliseconds kCrowdedPause = std::chrono::minutes(1);

  /// A copy that came round about may be faster than the hub's own word by so many changes.
  static constexpr std::uint64_t kHonestLead = 64;

  /// The pause between two looks for records that are too old.
  static constexpr std::chrono::milliseconds kForgetPause = std::chrono::seconds(10);

  NetworkState(HubIdentity self, HubWords words);

  /// Refuses each newcomer with a hub id in use: nobody has verified anything that it says of
  /// itself.
  [[nodiscard]] LinkAdmissionAnswer admit(const HubIdentity& newcomer) const;

  /// A connection of a link begins: the first one, or the next one after a break. All records go
  /// to it, then the mark that ends them. The link counts once the mark of the other side has come;
  /// one that counted goes on to count if the same process is at the other end.
  void begin_connection(LinkNumber number, LinkFacts facts, std::chrono::milliseconds now);
  void take_record(LinkNumber number, proto::Payload bytes, std::chrono::milliseconds now);
  /// RECORDS_END came.
  void take_mark(LinkNumber number);
  /// The digest in a keep-alive came.
  void take_digest(LinkNumber number, std::uint64_t digest, std::chrono::milliseconds now);
  void set_cost(LinkNumber number, std::uint16_t cost);
  /// A damped link broke too often: this hub says that it costs as much as it can, and computes its
  /// own ways by that, too. So it carries what has no other way, and all hubs have one map.
  void set_damped(LinkNumber number, bool damped);
  /// The map goes without it at once.
  void end_link(LinkNumber number);
  /// All records of the other side have come.
  [[nodiscard]] bool is_up(LinkNumber number) const {
    const auto found = links_.find(number);
    return found != links_.end() && found->second.has_mark;
  }
  /// This hub will end: from now on it says that its links cost as much as they can, so that others
  /// find ways around it. Its own ways stay.
  void announce_end() {
    ends_ = links_changed_ = true;
    own_.hurry();
  }
  /// Ends all links: after a verdict.
  void leave();
  /// Takes another hub id. REQUIRES: no link.
  void renumber(HubId hub);
  /// An id of 1024..4094 that no known record has, chosen by `random`.
  [[nodiscard]] HubId draw_hub_id(std::uint64_t random) const;

  void advance(std::chrono::milliseconds now);
  /// When advance() has something to do. Nothing: not before something comes.
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_due() const;
  [[nodiscard]] std::vector<Sending> take_sendings() { return std::exchange(sendings_, {}); }

  [[nodiscard]] const HubIdentity& self() const { return own_.identity(); }
  [[nodiscard]] const NetworkMap& map() const { return map_; }
  /// Counts the maps: another number is another map.
  [[nodiscard]] std::uint64_t maps() const { return maps_; }
  [[nodiscard]] const RecordStore& store() const { return store_; }
  [[nodiscard]] std::uint64_t digest() const { return store_.digest(); }
  [[nodiscard]] Verdict verdict() const;
  /// The link that brought more records than there is room for, at most one each kCrowdedPause.
  /// Nothing: there was none since the last call.
  [[nodiscard]] std::optional<LinkNumber> take_crowding() {
    return std::exchange(crowding_, std::nullopt);
  }
  /// A newer part of a neighbour's record that came over another link.
  struct Hearsay {
    LinkNumber link;  ///< that brought it
    proto::HubKey hub;
    std::uint64_t lead = 0;  ///< changes that it is ahead of what the hub itself said
  };
  /// One that no honest hub is likely to bring, at most one each kCrowdedPause. Nothing: there was
  /// none since the last call.
  [[nodiscard]] std::optional<Hearsay> take_forgery() {
    return std::exchange(forgery_, std::nullopt);
  }
  /// Parts of neighbours' records that other links brought and that were not taken.
  [[nodiscard]] std::uint64_t hearsay() const { return hearsay_; }
  /// Messages that were not what they should be.
  [[nodiscard]] std::uint64_t malformed() const { return malformed_; }

 private:
  struct Link {
    LinkFacts facts;
    bool has_mark = false;
    bool damped = false;
    [[nodiscard]] std::uint16_t cost() const { return damped ? LinkCost::kMost : facts.cost; }
    std::optional<std::chrono::milliseconds> differs_since;
    std::chrono::milliseconds repair_pause = kRepairPauses.first;
    PartPace pace;
    /// The newest part 0 of the peer's record that another link brought. Null: none.
    PartRef refused;
    LinkNumber refused_from;
  };
  [[nodiscard]] Link* find(LinkNumber number);
  void take(LinkNumber from, const PartRef& part, std::chrono::milliseconds now);
  [[nodiscard]] bool has_own_word(LinkNumber from, const proto::HubKey& hub) const;
  void refuse(LinkNumber from, const PartRef& part, std::chrono::milliseconds now);
  void say_own(std::chrono::milliseconds now);
  void compute_map(std::chrono::milliseconds now);
  void note_links();
  void send(LinkNumber link, const PartRef& part);
  void flood(const PartRef& part, LinkNumber except);
  [[nodiscard]] bool carries_rather(const Link& link, const Link& than) const;
  /// One link for each neighbour that counts; ascending by neighbour.
  [[nodiscard]] std::vector<CarryingLink> carrying_links() const;

  OwnRecord own_;
  RecordStore store_;
  NetworkMap map_;
  std::uint64_t maps_ = 1;
  std::map<LinkNumber, Link> links_;
  bool ends_ = false;
  bool links_changed_ = false;      ///< the own record is to say so
  bool map_changed_ = false;        ///< it is to be computed
  bool reachable_changed_ = false;  ///< the store is to know
  std::chrono::milliseconds next_map_at_ = std::chrono::milliseconds::min();
  ChangePace forget_pace_{{kForgetPause, kForgetPause}};
  ChangePace crowded_pace_{{kCrowdedPause, kCrowdedPause}};
  std::optional<LinkNumber> crowding_;
  std::vector<std::pair<LinkNumber, PartRef>> heard_again_;  ///< refused before their links ended
  ChangePace forgery_pace_{{kCrowdedPause, kCrowdedPause}};
  std::optional<Hearsay> forgery_;
  std::uint64_t hearsay_ = 0;
  std::vector<Sending> sendings_;
  std::uint64_t malformed_ = 0;
};

}  // namespace gimnet::hub
