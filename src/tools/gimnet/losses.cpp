#include "tools/gimnet/losses.hpp"

#include <algorithm>
#include <string_view>
#include <utility>

namespace gimnet::tool {

std::string loss_words(const SendCounts& counts, const std::string& target) {
  // A hub says the same of a service that took data a moment ago, and takes none any more.
  if (counts.loss_reason == LossReason::not_allowed && target.find('/') != std::string::npos)
    return counts.loss + "; or the service takes no data";
  if (counts.loss_reason != LossReason::no_such_node || Peer::parse(target)) return counts.loss;
  return "the hub reports no_such_node: " + target + " has left";
}

namespace {

struct Words {
  std::string what;
  std::string why;
};

void add_sentence(std::vector<std::string>& sentences, std::uint64_t count, std::uint64_t told,
                  const Words& words) {
  if (count == told) return;
  sentences.push_back(std::to_string(count) + " " + words.what +
                      (count == 1 ? " was lost: " : "s were lost: ") + std::string(words.why));
}

}  // namespace

std::string queue_full_words(std::string_view whose, const Peer& filled_by) {
  std::string words = "the queue of " + std::string(whose) + " at the hub was full";
  if (filled_by) words += ", mostly of what " + filled_by.text() + " sent";
  return words;
}

std::vector<std::string> LostMessages::news(std::int64_t now_ns) {
  const bool known = all() == told_.all() && counts_.queue_full == told_.queue_full &&
                     counts_.over_budget == told_.over_budget;
  if (known || !pace_.due(now_ns)) return {};
  return rest();
}

std::vector<std::string> LostMessages::rest() {
  std::vector<std::string> sentences;
  add_sentence(sentences, counts_.incomplete, told_.incomplete,
               {"message", "a part did not come, or did not fit the others"});
  add_sentence(sentences, counts_.too_large, told_.too_large,
               {"message", "larger than this end takes"});
  add_sentence(
      sentences, counts_.frames_broken_off, told_.frames_broken_off,
      {"frame", "on the way when the connection broke, and a large message has many frames"});
  add_sentence(sentences, counts_.unknown_service, told_.unknown_service,
               {"message", "of a service that this end does not know to have subscribed"});
  add_sentence(sentences, counts_.unreadable, told_.unreadable,
               {"frame", "another node broke the protocol, or sent a key without a GIMI header"});
  add_sentence(sentences, counts_.outdated, told_.outdated,
               {"message", "its sender had been started again, and had sent newer ones"});
  add_sentence(sentences, counts_.queue_full, told_.queue_full,
               {"frame", queue_full_words("this node", counts_.queue_filled_by)});
  add_sentence(sentences, counts_.over_budget, told_.over_budget,
               {"frame", std::string(kMemoryShort)});
  told_ = counts_;
  return sentences;
}

void MissedMessages::add_sentence(std::vector<std::string>& sentences, Count& count,
                                  const std::string& service, std::string_view what) {
  if (count.told == count.missed) return;
  count.told = count.missed;
  sentences.push_back(std::to_string(count.missed) +
                      (count.missed == 1 ? " message of " : " messages of ") + service +
                      std::string(what));
}

std::uint64_t MissedMessages::take(const Message& message) {
  const auto found = services_.find(message.service());
  auto& service =
      found != services_.end() ? found->second : services_[std::string(message.service())];
  const auto step = static_cast<std::int32_t>(message.sequence() - service.sequence);
  const bool same_stream = message.from().id == service.provider && !message.begins_stream();
  // It was counted as missed. Going back to it would count those behind it once more.
  if (same_stream && !message.plain() && step <= 0 && step > -kLateMost) return service.missed;
  // The first of a provider says where it stands; a provider that began again counts from 1.
  if (message.begins_stream() || message.plain()) {
    // Nothing is known to be missing.
  } else if (message.from().id == service.provider && step > 0) {
    if (step > 1) count(service, static_cast<std::uint32_t>(step - 1), message);
  } else if (take_lateness_ && take_lateness_(message.service()) && message.sequence() > 1) {
    const std::uint32_t early = message.sequence() - 1;
    service.missed += early;
    service.early.missed += early;
    untold_ = true;
  }
  service.provider = message.from().id;
  service.sequence = message.sequence();
  service.reconnects = message.reconnects();
  return service.missed;
}

void MissedMessages::count(Service& service, std::uint64_t missed, const Message& message) {
  service.missed += missed;
  if (message.reconnects() != service.reconnects) {
    service.broken.missed += missed;
    told_as_lost_ = 0;  // what was lost with the connection is among these
    untold_ = true;
    return;
  }
  if (message.latest()) {
    service.skipped.missed += missed;
    untold_ = true;
    return;
  }
  const std::uint64_t told = std::min(missed, told_as_lost_);
  told_as_lost_ -= told;
  cause_of(service, missed, message).missed += missed - told;
  untold_ = untold_ || missed != told;
}

std::uint64_t MissedMessages::skipped(std::string_view service) const {
  const auto found = services_.find(service);
  return found == services_.end() ? 0 : found->second.skipped.missed;
}

/// The hub tells of its drops before it sends what waits, and what comes behind the gaps. It may
/// tell once of several gaps, or of several before the first of them is seen here.
MissedMessages::Count& MissedMessages::cause_of(Service& service, std::uint64_t missed,
                                                const Message& message) {
  if (message.arrival_ns() - service.gap_ns > kOneFloodNs)
    service.queue_full.unexplained = service.over_budget.unexplained = 0;
  service.queue_full.look(queue_full_);
  service.over_budget.look(over_budget_);
  const bool full = service.queue_full.unexplained != 0;
  if (!full && service.over_budget.unexplained == 0) return service.unknown;
  service.gap_ns = message.arrival_ns();
  if (!full) {
    service.over_budget.explain(missed);
    return service.squeezed;
  }
  service.queue_full.explain(missed);
  if (queue_filled_by_.id == 0 || queue_filled_by_.id == message.from().id) return service.slow;
  flooder_ = queue_filled_by_;
  return service.flooded;
}

void MissedMessages::take_lost(const LostCounts& counts) {
  queue_full_ = counts.queue_full;
  over_budget_ = counts.over_budget;
  queue_filled_by_ = counts.queue_filled_by;
  const std::uint64_t lost =
      counts.incomplete + counts.too_large + counts.unknown_service + counts.outdated;
  told_as_lost_ += lost - lost_;
  lost_ = lost;
}

std::vector<std::string> MissedMessages::news(std::int64_t now_ns) {
  if (!untold_ || !pace_.due(now_ns)) return {};
  return rest();
}

std::vector<std::string> MissedMessages::rest() {
  std::vector<std::string> sentences;
  for (auto& [name, service] : services_) {
    add_sentence(
        sentences, service.early, name,
        " did not come: published before this node had heard of the service and subscribed to it");
    add_sentence(sentences, service.broken, name,
                 " did not come: the connection to the hub was broken");
    add_sentence(sentences, service.skipped, name, " skipped for newer ones (delivery latest)");
    add_sentence(sentences, service.slow, name, " did not come: this reader was too slow");
    add_sentence(sentences, service.flooded, name,
                 " did not come: " + queue_full_words("this reader", flooder_));
    add_sentence(sentences, service.squeezed, name, " did not come: " + std::string(kMemoryShort));
    // Nobody tells a reader whether it or the sender was in the way.
    add_sentence(sentences, service.unknown, name,
                 " did not come: this reader was too slow, or the sender's connection or a "
                 "link between hubs broke (`gimnet status` counts what the hub dropped)");
  }
  untold_ = false;
  return sentences;
}

}  // namespace gimnet::tool
