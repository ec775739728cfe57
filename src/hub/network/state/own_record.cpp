#include "hub/network/state/own_record.hpp"

#include <algorithm>
#include <utility>

#include "base/check.hpp"

namespace gimnet::hub {

using proto::route::Neighbour;
using proto::route::RecordPart;

bool is_preferred(const HubIdentity& hub, const HubIdentity& to) {
  if (hub.configured != to.configured) return hub.configured;
  return hub.key.unique < to.key.unique;
}

OwnRecord::OwnRecord(HubIdentity identity, HubWords words)
    : identity_(identity), words_(std::move(words)), go_on_pace_([&identity] {
        const auto pause = kGoOnPause + std::chrono::milliseconds(identity.instance.value() >> 56);
        return ChangePace::Pauses{pause, pause};
      }()) {
  parts_.front().changed = true;
}

void OwnRecord::set_neighbours(const std::vector<Neighbour>& neighbours) {
  for (Part& part : parts_) {
    const auto gone = std::erase_if(part.neighbours, [&neighbours](const Neighbour& each) {
      return !std::ranges::binary_search(neighbours, each.hub, {}, &Neighbour::hub);
    });
    if (gone != 0) part.changed = changed_ = true;
  }
  for (const Neighbour& each : neighbours) add(each);
}

void OwnRecord::add(const Neighbour& neighbour) {
  for (Part& part : parts_) {
    const auto at = std::ranges::lower_bound(part.neighbours, neighbour.hub, {}, &Neighbour::hub);
    if (at == part.neighbours.end() || at->hub != neighbour.hub) continue;
    if (at->cost != neighbour.cost) part.changed = changed_ = true;
    at->cost = neighbour.cost;
    return;
  }
  const auto has_room = [](const Part& part) {
    return part.neighbours.size() < proto::route::kNeighboursMax;
  };
  auto part = std::ranges::find_if(parts_, has_room);
  if (part == parts_.end()) {
    GIMNET_CHECK(parts_.size() < proto::route::kPartsMax);
    part = parts_.insert(part, Part{});
  }
  part->neighbours.insert(
      std::ranges::lower_bound(part->neighbours, neighbour.hub, {}, &Neighbour::hub), neighbour);
  part->changed = changed_ = true;
}

void OwnRecord::renumber(HubId hub) {
  identity_.key.hub = hub;
  say_all_again();
  changed_ = true;
}

void OwnRecord::say_all_again() {
  for (Part& part : parts_) part.changed = part.changed || part.sequence != 0;
}

void OwnRecord::hear(const RecordPart& heard) {
  if (heard.instance == identity_.instance) {
    if (heard.part >= parts_.size()) parts_.resize(heard.part + std::size_t{1});
    Part& part = parts_[heard.part];
    // A part that this hub never said was invented: it says that there is nothing in it. Nobody
    // heard of those before it.
    if (part.sequence == 0) part.changed = changed_ = true;
    if (heard.sequence <= part.sequence) return;
  }
  // The part would hold against what was said, or against what this hub says there next.
  RecordPart mine;
  mine.instance = identity_.instance;
  const bool said_it = heard.part < parts_.size() && parts_[heard.part].sequence != 0;
  mine.sequence = said_it ? parts_[heard.part].sequence : sequence_;
  RecordPart next = mine;
  next.sequence = sequence_;
  const bool equal = heard.sequence == mine.sequence || heard.sequence == next.sequence;
  if (!equal && !is_newer(heard, mine) && !is_newer(heard, next)) return;
  go_on_behind(heard.sequence);
  if (heard.instance == identity_.instance) return;
  behind_ = heard.instance;
  if (heard.part != 0 || heard.behind != identity_.instance) return;
  is_named_ = true;
  if (question_ && heard.sequence > *question_) living_copy_ = heard.instance;
}

void OwnRecord::forget_copy() {
  living_copy_.reset();
  question_.reset();
}

std::optional<std::chrono::milliseconds> OwnRecord::next_due() const {
  std::optional<std::chrono::milliseconds> due;
  if (changed_) due = change_pace_.next();
  if (pass_) due = std::min(due.value_or(go_on_pace_.next()), go_on_pace_.next());
  return due;
}

std::vector<PartRef> OwnRecord::take_due(std::chrono::milliseconds now) {
  const bool goes_on = pass_ && now >= go_on_pace_.next();
  const bool may_change = changed_ && now >= change_pace_.next();
  if (!goes_on && !may_change) return {};
  if (goes_on) {
    sequence_ = std::max(sequence_, *pass_);
    pass_.reset();
    if (std::exchange(is_named_, false)) question_ = sequence_ + 1;
    go_on_pace_.note_done(now);
    say_all_again();
  }
  if (may_change) change_pace_.note_done(now);
  changed_ = false;
  std::vector<PartRef> due;
  for (std::uint16_t number = 0; number < parts_.size(); ++number) {
    Part& part = parts_[number];
    if (!part.changed) continue;
    part.changed = false;
    part.sequence = ++sequence_;
    due.push_back(make_part(said(number)));
  }
  return due;
}

RecordPart OwnRecord::said(std::uint16_t number) const {
  RecordPart part;
  part.hub = identity_.key;
  part.instance = identity_.instance;
  part.configured = identity_.configured;
  part.part = number;
  part.sequence = parts_[number].sequence;
  if (number == 0) {
    part.behind = behind_;
    part.name = words_.name;
    part.version = words_.version;
    part.features = words_.features;
    part.features_required = words_.features_required;
  }
  part.neighbours = parts_[number].neighbours;
  return part;
}

}  // namespace gimnet::hub
