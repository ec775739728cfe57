#include "tools/gimnet/session.hpp"

#include <csignal>
#include <cstdio>
#include <cstring>
#include <vector>

#include "base/suggest.hpp"

namespace gimnet::tool {

void say(const std::string& sentence) { std::fprintf(stderr, "gimnet: %s\n", sentence.c_str()); }

std::optional<ExitCode> Session::join(NodeOptions how) {
  how.hub = options_.hub;
  how.shard = options_.shard;
  if (how.description.empty()) how.description = "gimnet tool";
  auto joined = Node::join(how);
  if (!joined) {
    const Status status = joined.failure().status;
    code_ = fail(joined.failure());
    if (status == Status::bad_argument || status == Status::bad_name) return ExitCode::usage;
    if (status == Status::timeout) return ExitCode::no_connection;
    return code_;
  }
  node_ = std::move(*joined);
  stop_.on_stop([this] { node_->close(); });
  return std::nullopt;
}

std::optional<Peer> Session::find(std::string_view name) {
  auto peer = node_->find(name);
  if (peer) return *peer;
  Failure failure = peer.failure();
  if (failure.status == Status::not_found) {
    failure.sentence = "there is no node '" + std::string(name) + "'";
    const auto nodes = node_->nodes("**");
    std::vector<std::string_view> names;
    if (nodes) {
      for (const NodeRecord& node : *nodes) names.push_back(node.name);
    }
    const std::string suggestion = did_you_mean(name, names);
    failure.sentence += suggestion.empty() ? "; `gimnet nodes` lists those that are there" : suggestion;
  }
  code_ = fail(failure);
  return std::nullopt;
}

ExitCode Session::fail(const Failure& failure) {
  if (stopped()) return stop_.signal() == SIGTERM ? ExitCode::terminated : ExitCode::interrupted;
  say(failure.sentence);
  return exit_code_of(failure.status);
}

ExitCode Session::finish() {
  output_.flush();
  if (!output_.ok()) {
    return fail({Status::system, std::string("cannot write to standard output: ") + std::strerror(output_.error())});
  }
  if (stopped()) return fail({});
  return ExitCode::done;
}

}  // namespace gimnet::tool
