#include "tools/gimnet/member_status.hpp"

#include <algorithm>

#include "base/clock.hpp"
#include "tools/gimnet/ask_each.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/network.hpp"
#include "tools/gimnet/session.hpp"

namespace gimnet::tool {
namespace {

bool has_error(const MemberStatus& member) { return !member.error.empty(); }

constexpr std::string_view kEnded = "ended";

/// The record that the hub at the other end has of the same link; nullptr: none that stands.
const LinkRecord* other_end(const std::vector<MemberStatus>& members, std::uint32_t hub,
                            const LinkRecord& link) {
  const auto other = std::ranges::find(members, link.hub_id, &MemberStatus::hub_id);
  if (other == members.end()) return nullptr;
  const auto same = std::ranges::find_if(other->links, [&](const LinkRecord& candidate) {
    return candidate.hub_id == hub && candidate.name == link.name &&
           candidate.dialled != link.dialled && candidate.state != kEnded;
  });
  return same == other->links.end() ? nullptr : &*same;
}

}  // namespace

bool links_agree(const std::vector<MemberStatus>& members) {
  for (const MemberStatus& member : members) {
    if (has_error(member)) return false;
    for (const LinkRecord& link : member.links) {
      // The one never came about, the other is no more.
      if (link.hub_id == 0 || link.state == kEnded) continue;
      const LinkRecord* const other = other_end(members, member.hub_id, link);
      if (other == nullptr && link.state == "dialling") continue;
      if (other == nullptr || link.delivered > other->accepted ||
          other->accepted > link.delivered + link.unsure)
        return false;
    }
  }
  return true;
}

std::string json_of(const std::vector<MemberStatus>& members, bool exact) {
  JsonWriter json;
  json.begin_object().member("exact", exact).key("hubs").begin_array();
  for (const MemberStatus& member : members) {
    json.begin_object().member("id", member.hub_id).member("name", member.name);
    if (member.error.empty()) {
      write(json.key("ledger"), member.ledger);
      write(json.key("links"), member.links);
    } else {
      json.member("error", member.error);
    }
    json.end_object();
  }
  return json.end_array().end_object().str() + "\n";
}

std::string text_of(const std::vector<MemberStatus>& members, bool exact, Paint paint) {
  std::string text;
  for (const MemberStatus& member : members) {
    text += "hub " + std::to_string(member.hub_id) + " " + printable(member.name) + ": ";
    if (!member.error.empty()) {
      text += paint(printable(member.error), Tone::bad) + "\n\n";
      continue;
    }
    text += text_of(member.ledger) + "\n";
    if (!member.links.empty()) text += text_of(member.links, paint);
    text += "\n";
  }
  if (std::ranges::any_of(members, has_error))
    return text + "the counts of the links are not compared, since not all hubs answered\n";
  return text + (exact ? "the counts of all links agree\n"
                       : "the counts of links do not agree (frames may be on their way)\n");
}

namespace {

/// The last frames of a link are confirmed with its keep-alive (250 ms), so counts of links that
/// have just become idle agree a moment later.
constexpr std::int64_t kSettledWithinNs = 1'000'000'000;
constexpr std::int64_t kAskAgainAfterNs = 100'000'000;

MemberStatus ask_member(ToolSession& session, const NetworkHub& hub) {
  MemberStatus member;
  const std::uint32_t whom = hub.distance == 0 ? 0 : hub.hub_id;
  const auto counters = session.node().hub_counters(kMemberPatience, whom);
  if (!counters) {
    member.error = counters.failure().sentence;
    return member;
  }
  const auto links = session.node().hub_links(kMemberPatience, whom);
  if (!links) {
    member.error = links.failure().sentence;
    return member;
  }
  member.ledger = ledger_of(summed(*counters));
  member.links = *links;
  return member;
}

/// One answer of each hub.
Outcome<std::vector<MemberStatus>> ask_all(ToolSession& session) {
  const auto hubs = session.node().hubs(kMemberPatience);
  if (!hubs) return hubs.failure();
  auto members = ask_each<MemberStatus>(
      *hubs, [&](const NetworkHub& hub) { return ask_member(session, hub); });
  for (std::size_t i = 0; i < members.size(); ++i) {
    members[i].hub_id = (*hubs)[i].hub_id;
    members[i].name = (*hubs)[i].name;
  }
  return members;
}

}  // namespace

std::string why_not_asked(const NetworkHub& hub) {
  if (hub.too_far) return "too far";
  return hub.reachable ? "" : std::string(kUnreachable);
}

ExitCode run_status_of_all(ToolSession& session) {
  auto members = ask_all(session);
  bool exact = false;
  const std::int64_t until = steady_now_ns() + kSettledWithinNs;
  // A hub that does not answer is asked once: without it no counts are exact.
  while (members && !exact && std::ranges::none_of(*members, has_error)) {
    const bool agreed = links_agree(*members);
    members = ask_all(session);
    exact = members && agreed && links_agree(*members);
    const std::int64_t next = steady_now_ns() + kAskAgainAfterNs;
    if (!exact && (next > until || !session.stop().wait_until(next))) break;
  }
  if (!members) return session.fail(members.failure());
  if (session.stopped()) return session.finish();
  session.output().write(session.options().json ? json_of(*members, exact)
                                                : text_of(*members, exact, session.paint()));
  return session.finish();
}

}  // namespace gimnet::tool
