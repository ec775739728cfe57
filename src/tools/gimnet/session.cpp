#include "tools/gimnet/session.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <utility>
#include <vector>

#include "base/suggest.hpp"
#include "tools/gimnet/advice.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {

void ConnectionWatch::look() { look("; trying to connect again"); }

void ConnectionWatch::look_at_end() { look(""); }

void ConnectionWatch::look_now_and_then(std::int64_t now_ns) {
  if (now_ns < next_look_ns_) return;
  next_look_ns_ = now_ns + std::chrono::nanoseconds(kPeriod).count();
  look();
}

void ConnectionWatch::look(const char* afterwards) {
  const NodeState state = node_.state();
  if (!state.peer || state.ended) return;
  // It may have come back already.
  const bool broke = connected_ && (!state.connected || state.reconnects != reconnects_);
  if (broke) say("the connection broke (" + state.trouble + ")" + afterwards);
  if (state.connected && (broke || !connected_)) {
    // Why it was closed, the hub often tells only who is back.
    const bool knows_more = !broke && state.trouble != told_;
    say("connected again as " + state.peer.text() +
        (knows_more ? " (before: " + state.trouble + ")" : ""));
  }
  if (broke) told_ = state.trouble;
  connected_ = state.connected;
  reconnects_ = state.reconnects;
}

bool ConnectionWatch::goes_on() {
  look();
  return !node_.state().ended;
}

void say(const std::string& sentence) {
  // Words of a hub or another node may have anything in them; of that, only ends of lines are for
  // the terminal.
  std::string shown;
  for (std::size_t begin = 0; begin <= sentence.size();) {
    const std::size_t end = std::min(sentence.find('\n', begin), sentence.size());
    shown +=
        (begin == 0 ? "" : "\n") + printable(std::string_view(sentence).substr(begin, end - begin));
    begin = end + 1;
  }
  std::fprintf(stderr, "gimnet: %s\n", shown.c_str());
}

NodeOptions ToolSession::options_for(NodeOptions how) const {
  how.hub = options_.hub;
  how.proxy = options_.proxy;
  how.shard = options_.shard;
  if (how.description.empty()) how.description = kToolDescription;
  return how;
}

std::optional<ExitCode> ToolSession::join(NodeOptions how) {
  stop_.end_at_once();
  return settle(Node::join(options_for(std::move(how))));
}

std::optional<ExitCode> ToolSession::join_to_look(NodeOptions how) {
  how = options_for(std::move(how));
  stop_.end_at_once();
  auto joined = Node::join(how);
  if (joined || !joined.is(Status::refused)) return settle(std::move(joined));
  how.administrator = true;
  auto as_administrator = Node::join(how);
  return settle(as_administrator ? std::move(as_administrator) : std::move(joined));
}

std::optional<ExitCode> ToolSession::settle(Outcome<Node> joined) {
  if (!joined) {
    Failure failure = joined.failure();
    // Of a hub behind a proxy the sentence says all.
    const bool straight = options_.proxy.empty() && std::getenv("GIMNET_PROXY") == nullptr;
    if (straight && (failure.status == Status::no_hub || failure.status == Status::no_host)) {
      if (!failure.sentence.ends_with('.') && !failure.sentence.ends_with('?'))
        failure.sentence += '.';
      failure.sentence += advice(
          failure.status == Status::no_host ? "look at its name" : "start one there with `tcphub`");
    }
    const ExitCode code = fail(failure);
    // The peer there lets nobody in, or is no hub.
    const bool no_hub = failure.status == Status::timeout || failure.status == Status::protocol;
    return no_hub && code == exit_code_of(failure.status) ? ExitCode::no_connection : code;
  }
  node_ = std::move(*joined);
  // A token file that cannot be used, or how the hub ended the node's last connection.
  if (const std::string trouble = node_->state().trouble; !trouble.empty()) say(trouble);
  stop_.on_stop([this] { node_->close(); });
  return std::nullopt;
}

std::optional<Peer> ToolSession::find(std::string_view name) {
  auto peer = node_->find(name);
  if (peer.is(Status::not_found) && is_listed(name))
    peer = node_->find(name);  // it came in between
  if (peer) {
    tell_if_away(name);
    return *peer;
  }
  Failure failure = peer.failure();
  if (failure.status == Status::not_found) {
    const bool sends = options_.command == Command::send;  // mostly to services
    failure.sentence =
        sends && name.find('/') != std::string_view::npos
            ? words_for_no_service(name)
            : "there is no node '" + std::string(name) + "'" + words_for_no_node(name);
  }
  code_ = fail(failure);
  return std::nullopt;
}

std::string ToolSession::id_words(std::string_view name) {
  if (name.empty() || name.find_first_not_of("0123456789") != std::string_view::npos) return {};
  const std::string own = node_->peer().text();
  return "; the id is written " + own.substr(0, own.find('.') + 1) + std::string(name);
}

std::string ToolSession::words_for_no_node(std::string_view name) {
  if (is_service(name)) return service_words(name);
  const std::size_t slash = name.rfind('/');
  if (slash == std::string_view::npos || !is_listed(name.substr(0, slash)))
    return id_words(name) + nearest_name("node", name);
  return ", and the node '" + std::string(name.substr(0, slash)) + "' has no service '" +
         std::string(name.substr(slash + 1)) + "'" + nearest_name("service", name);
}

std::string ToolSession::words_for_no_service(std::string_view name) {
  const std::string node(name.substr(0, name.rfind('/')));
  return "there is no service '" + std::string(name) + "'" +
         (is_listed(node) ? ": the node '" + node + "' has none of that name"
                          : ", and no node '" + node + "'") +
         nearest_name("service", name);
}

void ToolSession::tell_if_away(std::string_view name) {
  const auto nodes = node_->nodes(name);
  if (!nodes || nodes->empty() || nodes->front().name != name || nodes->front().connected) return;
  const NodeRecord& node = nodes->front();
  const bool unreachable = standing_of(node) == std::string_view{kUnreachable};
  say("the node '" + std::string(name) +
      (unreachable ? "' is unreachable: there is no way to its hub " + node.hub_name +
                         "; `gimnet hubs` shows when there is one"
                   : "' is away: its connection broke; `gimnet watch` shows when it is back"));
}

std::string_view ToolSession::standing_of(const NodeRecord& node) {
  if (node.connected) return "connected";
  if (node.hub_id == hub_of(NodeId{node_->peer().id}).value()) return "away";
  if (!hubs_) {
    auto hubs = node_->hubs();
    hubs_ = hubs ? std::move(*hubs) : std::vector<NetworkHub>{};
  }
  const auto hub = std::ranges::find(*hubs_, node.hub_id, &NetworkHub::hub_id);
  return hub == hubs_->end() || hub->reachable ? "away" : kUnreachable;
}

bool ToolSession::is_listed(std::string_view name) {
  const auto nodes = node_->nodes("**");
  return nodes &&
         std::ranges::any_of(*nodes, [&](const NodeRecord& node) { return node.name == name; });
}

bool ToolSession::is_service(std::string_view name) {
  if (name.find('/') == std::string_view::npos) return false;
  const auto services = node_->services(name);
  return services && std::ranges::any_of(*services, [&](const ServiceRecord& service) {
           return service.name == name;
         });
}

std::string ToolSession::service_words(std::string_view name) {
  return ": that is a service of the node " + std::string(name.substr(0, name.rfind('/')));
}

std::string ToolSession::wider_pattern(const std::string& kind, const std::string& word) {
  const std::string wider = word + "/**";
  const auto is_any = [](const auto& found) { return found && !found->empty(); };
  const bool any = kind == "node" ? is_any(node_->nodes(wider)) : is_any(node_->services(wider));
  return any ? "; did you mean '" + wider + "'?" : "";
}

/// --hub, or GIMNET_HUB; "": the hub of this machine.
std::string ToolSession::hub() const {
  if (!options_.hub.empty()) return options_.hub;
  const char* named = std::getenv("GIMNET_HUB");
  return named != nullptr ? named : "";
}

std::string ToolSession::advice(std::string remedy) const {
  if (options_.hub.empty() && !hub().empty()) {
    return " That address is GIMNET_HUB's: " + remedy + ", or change it";
  }
  if (options_.hub.empty()) return " Start one with `tcphub`, or name yours with --hub";
  remedy[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(remedy[0])));
  return " " + remedy + ", or name another with --hub";
}

std::string ToolSession::nearest_name(const std::string& kind, std::string_view word) {
  std::vector<std::string> names;
  if (kind == "node") {
    if (const auto nodes = node_->nodes("**")) {
      for (const NodeRecord& node : *nodes) names.push_back(node.name);
    }
  } else if (const auto services = node_->services("**")) {
    for (const ServiceRecord& service : *services) names.push_back(service.name);
  }
  const std::vector<std::string_view> views(names.begin(), names.end());
  const std::string suggestion = did_you_mean(word, views);
  return suggestion.empty() ? "; `gimnet " + kind + "s` lists those that are there" : suggestion;
}

ExitCode ToolSession::fail_unmatched(const std::string& kind) {
  output_.flush();
  const std::string& target = options_.target;
  const std::string sentence = "no " + kind + " matches '" + target + "'";
  if (kind == "node" && !is_pattern(target) && is_service(target)) {
    return fail({Status::not_found, sentence + service_words(target)});
  }
  const std::string wider = wider_pattern(kind, target);
  return fail({Status::not_found, sentence + (wider.empty() ? nearest_name(kind, target) : wider)});
}

ExitCode ToolSession::fail_unknown_service(const std::string& sentence) {
  output_.flush();
  const std::string& target = options_.target;
  const bool known = is_service(target);  // it is there, and answers no requests
  return fail({Status::not_found, known ? sentence : sentence + nearest_name("service", target)});
}

ExitCode ToolSession::fail(const Failure& failure) {
  if (stopped()) return exit_code_of_signal(stop_.signal());
  const bool lost = failure.status == Status::not_connected || failure.status == Status::refused;
  const NodeState state = lost && node_ ? node_->state() : NodeState{};
  const bool known =
      !state.trouble.empty() && (state.ended || failure.status == Status::not_connected);
  if (node_ && failure.status == Status::timeout && options_.hub_id != 0) {
    say("hub " + std::to_string(options_.hub_id) + " did not answer within 4.9 s; see gimnet hubs");
  } else {
    say(known ? "lost the connection to the hub: " + state.trouble
              : in_commands(failure.sentence, options_.target));
  }
  return exit_code_of(failure.status);
}

ExitCode ToolSession::finish() {
  if (!output_.finish()) return ExitCode::failed;
  return stopped() ? fail({}) : ExitCode::done;
}

ExitCode ToolSession::finish_stream(const Bounds& bounds, std::uint64_t messages) {
  const ExitCode code = finish();
  if (code != ExitCode::done || !output_.ok() || !bounds.late() || !bounds.missed(messages))
    return code;
  const bool events = options_.command == Command::watch;
  const std::string one = events ? "an event" : "a message";
  const std::string many = std::to_string(options_.count) + (events ? " events" : " messages");
  return fail({Status::timeout, "waited " + decimal(options_.seconds) + " s for " +
                                    (options_.count < 2 ? one : many) + " of " +
                                    (options_.target.empty() ? "anybody" : options_.target) + ": " +
                                    (messages == 0 ? "none" : "only " + std::to_string(messages)) +
                                    " came"});
}

}  // namespace gimnet::tool
