#pragma once

#include <unistd.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "gimnet/gimi.hpp"
#include "tools/gimnet/bounds.hpp"
#include "tools/gimnet/exit_code.hpp"
#include "tools/gimnet/options.hpp"
#include "tools/gimnet/output.hpp"
#include "tools/gimnet/stop_signal.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {

/// Tells breaks of the connection to the user, once each; not the last one, after which there is
/// nothing to wait for. Thread safety: one thread.
class ConnectionWatch {
 public:
  /// A break goes unnoticed at most this long by one that looks now and then.
  static constexpr Timeout kPeriod{500};

  /// `node` must outlive it.
  explicit ConnectionWatch(Node& node) : node_(node) {}
  void look();
  /// As look(), at most once in kPeriod: for a loop in which something comes all the time. `now_ns`
  /// as steady_now_ns().
  void look_now_and_then(std::int64_t now_ns);
  /// A message says over which connection it came: looks if that is a newer one than was known. Not
  /// at those that wait since before a break: a tool that lags behind may have thousands of them.
  void take(const Message& message) {
    if (message.reconnects() > reconnects_) look();
  }
  /// As look(), where nobody will try to connect any more; also of a node that was closed.
  void look_at_end();
  /// As look(). False: no connection will come any more.
  [[nodiscard]] bool goes_on();

 private:
  void look(const char* afterwards);

  Node& node_;
  bool connected_ = true;
  std::uint32_t reconnects_ = 0;
  std::int64_t next_look_ns_ = 0;
  std::string told_;  ///< why it broke last
};

/// The state of hubs to which there is no way, and of their nodes.
inline constexpr const char* kUnreachable = "unreachable";

/// The description of this tool's nodes.
inline constexpr const char* kToolDescription = "gimnet tool";

/// The things that a command works with. Thread safety: one thread.
class ToolSession {
 public:
  ToolSession(const ToolOptions& options, StopSignal& stop) : options_(options), stop_(stop) {}
  ~ToolSession() { stop_.on_stop({}); }
  ToolSession(const ToolSession&) = delete;
  ToolSession& operator=(const ToolSession&) = delete;

  [[nodiscard]] const ToolOptions& options() const { return options_; }
  [[nodiscard]] StopSignal& stop() { return stop_; }
  [[nodiscard]] Output& output() { return output_; }
  [[nodiscard]] Paint paint() const { return Paint::of(options_.colour, STDOUT_FILENO); }

  /// Joins as the options say. Errors: the code to end with; the words are printed.
  [[nodiscard]] std::optional<ExitCode> join(NodeOptions how);
  /// Joins to look at the hub: at one that takes no nodes any more, as an administrator, where this
  /// user is one.
  [[nodiscard]] std::optional<ExitCode> join_to_look(NodeOptions how = {});
  /// The hub that was asked for, by --hub or GIMNET_HUB; "": the hub of this machine.
  [[nodiscard]] std::string hub() const;
  /// REQUIRES: joined.
  [[nodiscard]] Node& node() { return *node_; }

  /// A node by name or id. Nothing: the words are printed, code() says how to end.
  [[nodiscard]] std::optional<Peer> find(std::string_view name);

  /// "connected", "away" (its own hub says that its connection broke), or "unreachable": there is
  /// no way to its hub. Asks for the network's hubs, once, if one of another hub is not connected.
  [[nodiscard]] std::string_view standing_of(const NodeRecord& node);

  /// Is there a service of that full name?
  [[nodiscard]] bool is_service(std::string_view name);

  /// No node or service (`kind`) matches the target: says so, with the nearest name.
  [[nodiscard]] ExitCode fail_unmatched(const std::string& kind);
  /// The target is no service that does what was asked: says so, with the nearest name.
  [[nodiscard]] ExitCode fail_unknown_service(const std::string& sentence);

  /// Prints why something did not work, and gives the code to end with: the signal's, if there was
  /// one.
  [[nodiscard]] ExitCode fail(const Failure& failure);
  /// No connection will come any more: what to give to fail().
  [[nodiscard]] static Failure gone() {
    return {Status::not_connected, "lost the connection to the hub"};
  }
  /// Ends well, unless the output could not be written or a signal came.
  [[nodiscard]] ExitCode finish();
  /// finish(), and timeout if time was up before there was what was asked for.
  [[nodiscard]] ExitCode finish_stream(const Bounds& bounds, std::uint64_t messages);
  [[nodiscard]] ExitCode code() const { return code_; }
  [[nodiscard]] bool stopped() { return stop_.signal() != 0; }

 private:
  /// The options of joining, with those of the command line filled in.
  [[nodiscard]] NodeOptions options_for(NodeOptions how) const;
  [[nodiscard]] std::optional<ExitCode> settle(Outcome<Node> joined);
  [[nodiscard]] std::string advice(std::string remedy) const;
  /// Words beside "there is no node": the service of that name, the node before the slash, or
  /// the nearest name.
  [[nodiscard]] std::string words_for_no_node(std::string_view name);
  /// That there is neither a node nor a service of that name, which has a slash.
  [[nodiscard]] std::string words_for_no_service(std::string_view name);
  void tell_if_away(std::string_view name);
  [[nodiscard]] bool is_listed(std::string_view name);
  /// Of a word that is a number: how an id is written; "" of any other.
  [[nodiscard]] std::string id_words(std::string_view name);
  [[nodiscard]] std::string nearest_name(const std::string& kind, std::string_view word);
  /// A suggestion where names of nodes or services begin with the word; "" if none do.
  [[nodiscard]] std::string wider_pattern(const std::string& kind, const std::string& word);
  /// That a service was called where a node was meant.
  [[nodiscard]] static std::string service_words(std::string_view name);

  const ToolOptions& options_;
  StopSignal& stop_;
  Output output_;
  std::optional<Node> node_;
  std::optional<std::vector<NetworkHub>> hubs_;  ///< once standing_of() had to ask
  ExitCode code_ = ExitCode::done;
};

/// A line for people, on standard error.
void say(const std::string& sentence);

// The commands, a file for each. They print data to the session's output and words to standard
// error.

[[nodiscard]] ExitCode run_send(ToolSession& session);
[[nodiscard]] ExitCode run_recv(ToolSession& session);
[[nodiscard]] ExitCode run_pub(ToolSession& session);
[[nodiscard]] ExitCode run_echo(ToolSession& session);
[[nodiscard]] ExitCode run_request(ToolSession& session);
[[nodiscard]] ExitCode run_answer(ToolSession& session);
[[nodiscard]] ExitCode run_hz(ToolSession& session);
[[nodiscard]] ExitCode run_bw(ToolSession& session);
[[nodiscard]] ExitCode run_ping(ToolSession& session);
[[nodiscard]] ExitCode run_trace(ToolSession& session);
[[nodiscard]] ExitCode run_nodes(ToolSession& session);
[[nodiscard]] ExitCode run_services(ToolSession& session);
[[nodiscard]] ExitCode run_watch(ToolSession& session);
[[nodiscard]] ExitCode run_status(ToolSession& session);
[[nodiscard]] ExitCode run_ctl(ToolSession& session);

}  // namespace gimnet::tool
