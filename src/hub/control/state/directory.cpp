#include "hub/control/state/directory.hpp"

#include <algorithm>

#include "base/check.hpp"
#include "base/ids.hpp"
#include "base/log.hpp"
#include "hub/control/state/topics.hpp"
#include "hub/network/state/name_copies.hpp"
#include "proto/control/names.hpp"

namespace gimnet::hub {
namespace {

using proto::Goodbye;
using proto::GoodbyeCode;
using std::chrono::milliseconds;

std::string quoted(std::string_view name) { return "the name '" + std::string{name} + "' "; }

Goodbye taken(std::string sentence) {
  return {GoodbyeCode::name_taken, std::move(sentence) + "; choose another name"};
}

std::string holder_of(const KnownName& known) {
  return "node " + to_string(known.claim->node) + " of hub " + std::to_string(known.hub.value());
}

std::string age_text(milliseconds age) {
  const auto seconds = age.count() / 1'000;
  if (seconds < 120) return std::to_string(seconds) + " s";
  if (seconds < 7'200) return std::to_string(seconds / 60) + " min";
  return std::to_string(seconds / 3'600) + " h";
}

}  // namespace

std::optional<NodeIndex> Directory::find(std::string_view name) const {
  const auto found = names_.find(name);
  return found == names_.end() ? std::nullopt : std::optional{found->second};
}

bool Directory::is_service(std::string_view name) const {
  const Topic* topic = topics_.find(name);
  return topic != nullptr && topic->provided();
}

std::optional<Goodbye> Directory::refusal(std::string_view name, const Claimant& claimant,
                                          milliseconds now) const {
  if (const char* fault = proto::node_name_fault(name)) {
    return Goodbye{GoodbyeCode::bad_name, "the name '" + escaped(name, kQuotedMax) +
                                              "' cannot be taken: " + fault +
                                              "; choose another one"};
  }
  if (claimant.session != nullptr && claimant.session->name == name) return std::nullopt;
  if (std::optional<Goodbye> refusal = holder_refusal(name, now)) return refusal;
  if (is_service(name)) return taken(quoted(name) + "is the full name of a service");
  return network_refusal(name, claimant, now);
}

std::optional<Goodbye> Directory::holder_refusal(std::string_view name, milliseconds now) const {
  const std::optional<NodeIndex> index = find(name);
  if (!index) return std::nullopt;
  const Session* holder = sessions_.find(*index);
  GIMNET_CHECK(holder != nullptr);
  if (!holder->connected) return std::nullopt;
  return Goodbye{GoodbyeCode::name_taken, quoted(name) + "is held by node " +
                                              to_string(sessions_.node_id(*holder)) +
                                              ", connected over " + holder->origin.transport.str() +
                                              " from " + holder->origin.address.str() + " since " +
                                              age_text(now - holder->connected_at) +
                                              "; end that one, or choose another name"};
}

std::optional<Goodbye> Directory::network_refusal(std::string_view name, const Claimant& claimant,
                                                  milliseconds now) const {
  if (network_ == nullptr) return std::nullopt;
  const auto known = network_->find(name);
  if (!known || known->hub == network_->self().hub) return std::nullopt;
  if (known->claim->service)
    return taken(quoted(name) + "is the full name of a service of " + holder_of(*known));
  if (known->standing == proto::ns::NameStanding::held)
    return taken(quoted(name) + "is held by " + holder_of(*known));
  if (known->standing == proto::ns::NameStanding::away) return std::nullopt;
  // Nobody can be asked for a better proof.
  if (known->claim->node == claimant.former || claimant.had_name) return std::nullopt;
  const auto left = std::max<std::int64_t>(1, (known->until - now).count() / 1'000);
  return Goodbye{GoodbyeCode::name_taken,
                 quoted(name) + "is that of " + holder_of(*known) +
                     ", which cannot be reached; it is free in " + std::to_string(left) +
                     " s, unless that hub comes back; wait, or choose another name"};
}

std::optional<proto::Refusal> Directory::service_refusal(std::string_view full_name) const {
  std::string holder;
  if (const auto index = find(full_name)) {
    holder = "node " + to_string(sessions_.node_id(*sessions_.find(*index)));
  } else if (const auto known = network_ == nullptr ? std::nullopt : network_->find(full_name);
             known && !known->claim->service) {
    holder = holder_of(*known);
  }
  if (holder.empty()) return std::nullopt;
  return proto::Refusal{proto::Status::taken, "the full name of the service, '" +
                                                  std::string{full_name} + "', is the name of " +
                                                  holder + "; choose another name"};
}

void Directory::put(std::string_view name, NodeIndex index) {
  const bool added = names_.emplace(std::string{name}, index).second;
  GIMNET_CHECK(added);
}

void Directory::remove(std::string_view name) {
  const auto found = names_.find(name);
  if (found != names_.end()) names_.erase(found);
}

}  // namespace gimnet::hub
