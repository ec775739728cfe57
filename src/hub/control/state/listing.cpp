#include "hub/control/state/listing.hpp"

#include <algorithm>
#include <string>
#include <string_view>

namespace gimnet::hub {
namespace {

/// Takes the first `most` of what was found.
template <class Index>
Listed<Index> first_of(std::vector<Index> indices, std::size_t most) {
  std::ranges::sort(indices);
  Listed<Index> listed;
  listed.more = indices.size() > most;
  if (listed.more) indices.resize(most);
  if (listed.more) listed.next = indices.back();
  listed.indices = std::move(indices);
  return listed;
}

/// By name: all whose names begin with the same parts as the pattern, if those are few. `wanted`
/// says the index of an entry that is to be listed, or its 0. Nothing: they are too many.
template <class Index, class ByName, class Wanted>
std::optional<Listed<Index>> list_by_name(const ByName& by_name,
                                          const ListingRequest<Index>& request, Wanted wanted) {
  if (request.pattern == nullptr || request.pattern->beginning().empty()) return std::nullopt;
  const std::string_view beginning = request.pattern->beginning();
  std::vector<Index> found;
  std::size_t work = request.work;
  const auto look_at = [&](const auto& entry) {
    --work;
    if (!request.pattern->matches(entry.first)) return;
    const Index index = wanted(entry.second);
    if (index > request.after) found.push_back(index);
  };
  // Any number of names may begin with the same letters and not match, as hall-30 does for
  // hall-3/*.
  if (const auto exact = by_name.find(beginning); exact != by_name.end()) {
    if (work == 0) return std::nullopt;
    look_at(*exact);
  }
  if (!request.pattern->is_name()) {
    const std::string within = std::string{beginning} + '/';
    for (auto entry = by_name.lower_bound(within); entry != by_name.end(); ++entry) {
      if (!entry->first.starts_with(within)) break;
      if (work == 0) return std::nullopt;
      look_at(*entry);
    }
  }
  Listed<Index> listed = first_of(std::move(found), request.most);
  listed.looked_at = request.work - work;
  return listed;
}

/// By id, from where the last piece ended.
template <class Index, class ById, class Wanted>
Listed<Index> list_by_id(const ById& by_id, const ListingRequest<Index>& request, Wanted wanted) {
  Listed<Index> listed;
  std::size_t work = request.work;
  for (auto entry = by_id.upper_bound(request.after); entry != by_id.end(); ++entry) {
    if (work == 0 || listed.indices.size() == request.most) {
      listed.more = true;
      break;
    }
    --work;
    listed.next = entry->first;
    if (wanted(entry->second)) listed.indices.push_back(entry->first);
  }
  if (!listed.more) listed.next = Index{};
  listed.looked_at = request.work - work;
  return listed;
}

}  // namespace

std::optional<Listed<NodeIndex>> list_few_nodes(const Membership& membership,
                                                const ListingRequest<NodeIndex>& request) {
  const auto& sessions = membership.sessions();
  return list_by_name(membership.directory().names(), request, [&](NodeIndex holder) {
    return request.connected_only && !sessions.find(holder)->connected ? NodeIndex{} : holder;
  });
}

std::optional<Listed<GroupIndex>> list_few_services(const Topics& topics,
                                                    const ListingRequest<GroupIndex>& request) {
  return list_by_name(topics.by_name(), request, [](const Topic& topic) {
    return topic.provided() ? topic.service->group : kNoGroup;
  });
}

Listed<NodeIndex> list_nodes(const Membership& membership,
                             const ListingRequest<NodeIndex>& request) {
  if (const auto few = list_few_nodes(membership, request)) return *few;
  return list_by_id(membership.sessions().all(), request, [&](const Session& session) {
    if (request.connected_only && !session.connected) return false;
    return request.pattern == nullptr ||
           (!session.name.empty() && request.pattern->matches(session.name));
  });
}

Listed<GroupIndex> list_services(const Topics& topics, const ListingRequest<GroupIndex>& request) {
  if (const auto few = list_few_services(topics, request)) return *few;
  return list_by_id(topics.groups(), request, [&](const Topic* topic) {
    if (!topic->provided()) return false;
    return request.pattern == nullptr || request.pattern->matches(topic->full_name);
  });
}

}  // namespace gimnet::hub
