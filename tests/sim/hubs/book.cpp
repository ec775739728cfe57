#include "tests/sim/hubs/book.hpp"

#include "base/endian.hpp"
#include "base/ids.hpp"

namespace gimnet::sim::hubs {
namespace {

/// A frame that is dropped for its hops was written to one link more than it may cross.
constexpr std::uint32_t kWrittenMost = proto::kHopsMax + 1;

bool is_for_one(proto::Kind kind) {
  return kind == proto::Kind::unicast || kind == proto::Kind::service;
}

}  // namespace

std::uint64_t Book::note_session(std::size_t hub, NodeId node, bool is_new) {
  const auto [found, added] = holders_.try_emplace(node);
  Holder& holder = found->second;
  if (added) known_.push_back(node);
  if (!added && holder.hub != hub) holder.ambiguous = true;
  holder.hub = hub;
  if (is_new || added) holder.session = ++last_session_;
  return holder.session;
}

std::uint64_t Book::session_of(NodeId node) const {
  const auto found = holders_.find(node);
  return found == holders_.end() || found->second.ambiguous ? 0 : found->second.session;
}

std::uint64_t Book::note_sent(std::size_t hub, std::uint64_t session) {
  letters_.push_back({session, hub, {}, 0, false});
  return letters_.size() - 1;
}

Book::Letter* Book::find(std::span<const std::byte> payload) {
  if (payload.size() < kNumberBytes) return nullptr;
  const auto number = load_le<std::uint64_t>(payload.data());
  return number < letters_.size() ? &letters_[number] : nullptr;
}

void Book::note_crossing(const Crossing& crossing, const proto::FrameHeader& header,
                         std::span<const std::byte> payload) {
  if (header.kind == proto::Kind::report && header.hops > proto::kHopsMax)
    broken(Checker::hops, "a REPORT crosses more links than it may");
  if (!is_for_one(header.kind)) return;
  Letter* const letter = find(payload);
  if (letter == nullptr) return broken(Checker::right_node, "a link carries what nobody sent");
  const bool again = letter->links != 0 && letter->last == crossing;
  if (again) {
    if (header.hops + 1u != letter->links)
      broken(Checker::hops, "a frame has other hops when it is written again");
    return;
  }
  const std::string words = "frame " + std::to_string(letter - letters_.data()) + " on wire " +
                            std::to_string(crossing.wire) + " from hub " +
                            std::to_string(crossing.from) + " to " + std::to_string(crossing.to);
  if (letter->links != 0 && letter->last.to == crossing.from && letter->last.from == crossing.to)
    broken(Checker::never_back, words + " goes back to where it came from");
  const std::size_t at = letter->links == 0 ? letter->origin : letter->last.to;
  if (at != crossing.from)
    broken(Checker::one_link, words + " was on its way from hub " +
                                  std::to_string(letter->last.from) + " to " + std::to_string(at));
  if (header.hops != letter->links)
    broken(Checker::hops, words + " says " + std::to_string(header.hops) + " hops after " +
                              std::to_string(letter->links));
  letter->last = crossing;
  if (++letter->links > kWrittenMost) broken(Checker::hops, words + " crosses too many links");
}

void Book::note_arrived(std::span<const std::byte> payload, std::uint64_t session) {
  Letter* const letter = find(payload);
  if (letter == nullptr) return broken(Checker::right_node, "a node gets what nobody sent");
  const std::string words = "frame " + std::to_string(letter - letters_.data());
  if (letter->arrived) broken(Checker::right_node, words + " arrives twice");
  if (letter->session != 0 && letter->session != session)
    broken(Checker::right_node, words + " reaches session " + std::to_string(session) +
                                    " and was for " + std::to_string(letter->session));
  letter->arrived = true;
  ++arrived_;
}

}  // namespace gimnet::sim::hubs
