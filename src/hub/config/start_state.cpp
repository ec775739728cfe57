#include "hub/config/start_state.hpp"

#include <sys/stat.h>

#include <cctype>
#include <cerrno>
#include <span>

#include "base/log.hpp"
#include "base/random.hpp"
#include "hub/config/folders.hpp"

namespace gimnet::hub {
namespace {

/// The first index of a block that an earlier hub has hardly used.
std::uint32_t random_mark() {
  const auto number = static_cast<std::uint32_t>(random_bits());
  return 1 + number % (kIndexMost / IndexPool::kBlock) * IndexPool::kBlock;
}

/// `known_first`: there was no hub before whose nodes might still come back.
HubState new_state(bool known_first) {
  HubState state;
  fill_randomly(state.secret);
  fill_randomly(state.unique_id);
  if (!known_first) {
    state.node_mark = random_mark();
    state.group_mark = random_mark();
  }
  return state;
}

StartState in_memory(bool known_first) {
  StartState result;
  result.start.state = new_state(known_first);
  result.start.state.boot = 1;
  result.start.nodes.first = result.start.state.node_mark;
  result.start.groups.first = result.start.state.group_mark;
  return result;
}

Result<StartState> go_on_from(std::unique_ptr<StateFolder> folder,
                              const std::optional<HubState>& found,
                              std::chrono::milliseconds wall) {
  if (!found && folder->was_used()) {
    log_warning("there is no state in " + folder->path() +
                " any more: the hub begins anew, and nodes that come back get new ids");
  }
  Result<HubStart> start = next_start(found ? *found : new_state(!folder->was_used()), wall);
  if (!start)
    return Error{"cannot go on from " + folder->path() + "/state: " + start.error().sentence};
  if (const std::string error = folder->write(start->state); !error.empty()) return Error{error};
  return StartState{std::move(*start), std::move(folder)};
}

bool is_there(const std::string& path) {
  struct stat info{};
  return ::lstat(path.c_str(), &info) == 0 || errno != ENOENT;
}

StartState without_folder(const std::string& why) {
  log_warning("the hub keeps nothing over a restart (" + why +
              "): nodes then get new ids; --state-dir DIR names a folder for its state");
  return in_memory(false);
}

}  // namespace

std::string state_folder_name(HubId hub, const ListenUrl& address) {
  const bool tcp = address.scheme == ListenUrl::Scheme::tcp;
  if (tcp && address.port == 0) return {};
  std::string name = "hub-" + std::to_string(hub.value()) + "-";
  for (const char c :
       tcp ? "tcp-" + address.host + "-" + std::to_string(address.port) : "unix" + address.path) {
    const bool plain =
        std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.' || c == '-' || c == '_';
    name += plain ? c : (c == '/' ? '-' : '_');
  }
  return name;
}

Result<StartState> start_state(const StateWish& wish) {
  const bool asked_for = !wish.folder.empty();
  std::string path = wish.folder;
  if (!asked_for) {
    const std::string name = state_folder_name(wish.hub, wish.address);
    if (name.empty()) return in_memory(true);
    const Result<std::string> place = default_state_folder(name);
    if (!place) return without_folder(place.error().sentence);
    path = *place;
  }
  // A folder that was there may hold what another hub lives on, or what this one has to go on from.
  const bool was_there = is_there(path);
  auto folder = StateFolder::open(path);
  if (!folder) {
    if (asked_for || was_there) return folder.error();
    return without_folder(folder.error().sentence);
  }
  const auto found = (*folder)->read();
  if (!found) return found.error();
  const bool was_used = (*folder)->was_used();
  Result<StartState> result = go_on_from(std::move(*folder), *found, wish.wall);
  if (result || asked_for || *found || was_used) return result;
  return without_folder(result.error().sentence);
}

}  // namespace gimnet::hub
