#include "hub/control/state/directory.hpp"

#include "base/check.hpp"
#include "base/id_text.hpp"
#include "base/log.hpp"
#include "proto/control/names.hpp"

namespace gimnet::hub {
namespace {

std::string age_text(std::chrono::milliseconds age) {
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

std::optional<proto::Goodbye> Directory::refusal(std::string_view name, const Session* claimant,
                                                 const Sessions& sessions,
                                                 std::chrono::milliseconds now) const {
  if (const char* fault = proto::node_name_fault(name)) {
    return proto::Goodbye{proto::GoodbyeCode::bad_name, "the name '" + escaped(name, kQuotedMax) +
                                                            "' cannot be taken: " + fault +
                                                            "; choose another one"};
  }
  const std::optional<NodeIndex> index = find(name);
  if (!index || (claimant != nullptr && claimant->index == *index)) return std::nullopt;
  const Session* holder = sessions.find(*index);
  GIMNET_CHECK(holder != nullptr);
  if (!holder->connected) return std::nullopt;
  return proto::Goodbye{
      proto::GoodbyeCode::name_taken,
      "the name '" + std::string{name} + "' is held by node " +
          to_string(sessions.node_id(*holder)) + ", connected over " +
          holder->origin.transport.str() + " from " + holder->origin.address.str() + " since " +
          age_text(now - holder->connected_at) + "; end that one, or choose another name"};
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
