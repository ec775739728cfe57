#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "gimnet/gimi.hpp"
#include "tools/gimnet/ctl.hpp"
#include "tools/gimnet/impair.hpp"

namespace gimnet::tool {

enum class Command : std::uint8_t {
  send,
  recv,
  pub,
  echo,
  request,
  answer,
  hz,
  bw,
  ping,
  trace,
  nodes,
  services,
  watch,
  status,
  hubs,
  links,
  routes,
  graph,
  impair,
  ctl
};

/// Are several names meant?
[[nodiscard]] inline bool is_pattern(std::string_view word) {
  return word.find('*') != std::string_view::npos;
}

/// When to print colours: on a terminal, unless NO_COLOR says no.
enum class Colour : std::uint8_t { automatic, always, never };

/// The command line. Thread safety: immutable once read.
struct ToolOptions {
  Command command = Command::status;
  std::string hub;    ///< "": the environment's GIMNET_HUB, else the hub of this machine
  std::string proxy;  ///< "": the environment's GIMNET_PROXY
  bool json = false;
  Colour colour = Colour::automatic;
  std::optional<std::uint8_t> shard;

  std::string target;  ///< send, ping: name or id; send, pub: service; others: service or pattern
  std::string name;    ///< of this node
  std::string file;
  bool raw = false;
  bool all = false;
  bool changes = false;
  std::uint32_t hub_id = 0;  ///< of the hub to ask; 0: the own one
  bool dot = false;
  bool ascii = false;
  std::uint64_t count = 0;  ///< 0: no end
  double seconds = 0.0;     ///< 0: no end
  double window_s = 5.0;
  std::uint64_t pings = 10;
  double interval_s = 0.1;
  double timeout_s = 1.0;
  double rate_hz = 0.0;  ///< 0: as fast as possible
  std::size_t subscribers = 0;
  std::size_t bytes_max = std::size_t{64} << 20;
  Delivery delivery = Delivery::stream;
  std::uint32_t window = 1;  ///< of delivery sync
  bool retain = false;
  bool stay = false;
  std::string text;  ///< of a request
  bool echo_back = false;
  SubscribeOptions wish;  ///< of what is subscribed
  Lane lane = Lane::normal;
  MessageKey key;
  CtlOptions ctl;
  ImpairOptions impair;
};

}  // namespace gimnet::tool
