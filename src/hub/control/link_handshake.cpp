#include "hub/control/link_handshake.hpp"

#include <algorithm>
#include <string>
#include <utility>

namespace gimnet::hub {

using proto::Goodbye;
using proto::GoodbyeCode;

std::optional<Goodbye> LinkHandshake::refusal(const Stranger& stranger,
                                              const proto::Hello& hello) const {
  if (!parts_.options.accept) {
    return Goodbye{GoodbyeCode::not_allowed,
                   "this hub takes no links; start it with --accept-links, or set accept_links = "
                   "true below [links]"};
  }
  if (stranger.peer.transport == "unix" && !stranger.rights.administer) {
    return Goodbye{GoodbyeCode::not_allowed,
                   "over a Unix socket only the user that runs the hub, and root, may link"};
  }
  if (!hello.introduction || !is_link_name(hello.introduction->link_name)) {
    return Goodbye{GoodbyeCode::malformed,
                   "a HELLO of a hub without its id and the link's name, which is 1 to 255 bytes "
                   "without spaces and control characters"};
  }
  if (hello.introduction->features_required != 0) {
    return Goodbye{GoodbyeCode::bad_version,
                   "that hub requires features that this one does not have; use programs of one "
                   "version"};
  }
  return std::nullopt;
}

std::optional<Goodbye> LinkHandshake::refusal_of(const proto::HubIntroduction& said,
                                                 const LinkAdmissionAnswer& answer) const {
  switch (answer.admission) {
    case LinkAdmission::accept:
      return std::nullopt;
    case LinkAdmission::is_self:
      return Goodbye{GoodbyeCode::copied, "the link leads back to the same hub; name another one"};
    case LinkAdmission::ask_old_link:
      return Goodbye{GoodbyeCode::draining,
                     "the hub with this state folder was heard a moment ago; try again"};
    case LinkAdmission::is_copy:
      return Goodbye{GoodbyeCode::copied,
                     "another hub with the same state folder is linked already; delete the state "
                     "folder on one of the machines that have a copy of it"};
    case LinkAdmission::draw_again:
      return Goodbye{GoodbyeCode::draining,
                     "this hub has the same hub id, and draws another one; try again"};
    case LinkAdmission::id_taken: {
      const bool own = said.hub.hub == parts_.facts.id;
      const std::string holder = own             ? "hub '" + parts_.facts.name + "'"
                                 : answer.holder ? describe(*answer.holder)
                                                 : "another hub";
      return Goodbye{GoodbyeCode::id_taken, "hub id " + std::to_string(said.hub.hub.value()) +
                                                " is taken by " + holder +
                                                "; give one of them another one with --hub-id"};
    }
  }
  return std::nullopt;
}

std::string LinkHandshake::describe(const proto::HubKey& holder) const {
  const StoredRecord* record = parts_.network.store().find(holder);
  const auto* head = record == nullptr ? nullptr : record->head();
  const std::string name =
      head == nullptr || head->name.empty() ? "another hub" : "hub '" + head->name + "'";
  const auto& ways = parts_.network.map().ways();
  const auto way = std::ranges::find(ways, holder, &Way::hub);
  const auto link = way == ways.end() ? parts_.links.end() : parts_.links.find(way->link);
  if (link == parts_.links.end()) return name;
  const std::string& address = link->second->address;
  return name + (way->hops == 1 ? ", linked at " + address
                                : ", " + std::to_string(way->hops) + " links away behind " +
                                      link->second->title() + " at " + address);
}

std::string LinkHandshake::taken_sentence(const HubLink* over) const {
  const proto::HubKey& holder = parts_.network.map().own_id_holder()->hub;
  const StoredRecord* record = parts_.network.store().find(holder);
  const std::string name = record == nullptr ? std::string{} : record->head()->name;
  return "hub id " + std::to_string(holder.hub.value()) + " is kept by another hub" +
         (name.empty() ? "" : " '" + name + "'") +
         (over == nullptr ? "" : ", as " + over->title() + " says over link " + over->name()) +
         "; give one of them another one with --hub-id";
}

proto::HubIntroduction LinkHandshake::introduce(const LinkTerms& terms) const {
  const HubIdentity& self = parts_.network.self();
  proto::HubIntroduction said;
  said.hub = self.key;
  said.instance = self.instance;
  said.configured = self.configured;
  said.hub_name = parts_.facts.name;
  said.version = parts_.facts.version.substr(0, proto::kIntroducedVersionBytesMax);
  said.keep_alive_ms = terms.keep_alive_ms;
  said.silent_ms = terms.silent_ms;
  return said;
}

proto::Welcome LinkHandshake::welcome(const proto::HubIntroduction& said, const LinkTerms& terms,
                                      std::int64_t wall_ns) const {
  proto::Welcome welcome;
  welcome.node = make_id<NodeId>(said.hub.hub, kHubIndex);
  welcome.hub = parts_.facts.id;
  welcome.hub_name = parts_.facts.name;
  welcome.frame_length_max = static_cast<std::uint32_t>(parts_.limits.frame_bytes);
  welcome.hub_time_ns = wall_ns;
  welcome.introduction = introduce(terms);
  welcome.introduction->counts = said.counts;
  return welcome;
}

AttachCommand LinkHandshake::accept(Stranger& stranger, const proto::Hello& hello,
                                    const proto::HubIntroduction& said,
                                    std::int64_t wall_ns) const {
  AttachCommand command;
  command.transport = std::move(stranger.transport);
  command.resume_wanted = hello.resume;
  command.peer_epoch = hello.epoch;
  command.known_hub_epoch = hello.resume_epoch;
  command.known_taken = hello.resume_taken;
  command.peer_resume_bytes = hello.resume_buffer_bytes;
  command.peer_frame_bytes = hello.frame_length_max;
  command.welcome = welcome(said, parts_.options.accepted, wall_ns);
  return command;
}

proto::Hello LinkHandshake::hello_for(const HubLink& link, std::uint64_t counts) const {
  proto::Hello hello;
  hello.role = proto::Role::hub;
  hello.resume = true;
  hello.epoch = link.epoch;
  hello.resume_epoch = link.peer_epoch;
  hello.resume_taken = link.taken;
  hello.frame_length_max = static_cast<std::uint32_t>(parts_.limits.frame_bytes);
  hello.resume_buffer_bytes = kLinkResumeBytes;
  hello.introduction = introduce(link.dialled().terms);
  hello.introduction->link_name = link.name();
  hello.introduction->cost = link.dialled().cost;
  hello.introduction->counts = counts;
  return hello;
}

}  // namespace gimnet::hub
