#include "tools/demo/options.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <vector>

#include "proto/control/names.hpp"
#include "tools/demo/log_player.hpp"

namespace gimnet::demo {
namespace {

constexpr std::string_view kUsage =
    R"(gimnet-demo: a robot, a hub, and a live picture of the robot in the terminal

  gimnet-demo                       a simulated robot, driven with W A S D
  gimnet-demo --log FILE.log.gz     the recorded run of a real robot (CARMEN format)
  gimnet-demo --seconds 10          drives a course by itself, ends with a summary from the hub's counters;
                                    the exit code is 0 if nothing was lost, else 1

  gimnet-demo --labs                two laboratories with a hub each, a WAN between that is cut now and then,
                                    a hub inside a robot, three machines, a camera for two viewers; the exit code
                                    is 0 if only what was to cross the WAN in a cut was lost, else 1

Starts a hub of its own, and the robot as a separate process. For your own hub, or two computers:

  gimnet-demo robot --hub URL       only the robot
  gimnet-demo view --hub URL        only the viewer and driver

  --log FILE       plays a log, compressed with gzip or not; lines that cannot be read are skipped and counted
  --speed X        plays it X times as fast as recorded, 0.1 to 100 (1)
  --map FILE       another hall for the simulated robot: lines of # (wall), blanks, @ (start), 1 to 9 (course)
  --seconds N      ends after N seconds
  --hub URL        tcp://host:port or unix:/path; also from GIMNET_HUB
  --robot NAME     the robot's name in the network (robot)
  --ascii, --utf8  which characters to draw with; by default as the environment says
  --help           this text

NO_COLOR turns colours off. While it runs, ? shows the keys.
)";

// The roles in which an argument means something.
enum : unsigned { kInAll = 1, kInRobot = 2, kInView = 4, kEverywhere = 7 };

struct Argument {
  std::string_view name;
  bool takes_value;
  unsigned roles;
};
constexpr Argument kArguments[] = {{"--log", true, kInAll | kInRobot},
                                   {"--map", true, kInAll | kInRobot},
                                   {"--speed", true, kInAll | kInRobot},
                                   {"--seconds", true, kInAll | kInView},
                                   {"--hub", true, kInRobot | kInView},
                                   {"--robot", true, kEverywhere},
                                   {"--ascii", false, kInAll | kInView},
                                   {"--utf8", false, kInAll | kInView},
                                   {"--labs", false, kInAll},
                                   {"--help", false, kEverywhere},
                                   {"-h", false, kEverywhere}};

std::optional<Error> read_number(auto& out, std::string_view name, std::string_view text,
                                 double least, double most) {
  double value = 0.0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  // The comparison is false for NaN, too.
  const bool within = value >= least && value <= most;
  if (code != std::errc{} || end != text.data() + text.size() || !within)
    return Error{fmt::format("{} takes a number from {} to {}, not '{}'", name, least, most, text)};
  out = value;
  return std::nullopt;
}

std::optional<Error> read_text(std::string& out, std::string_view name, std::string_view text) {
  if (text.empty())
    return Error{fmt::format("{} is empty; give it a value, or leave it out", name)};
  out = text;
  return std::nullopt;
}

// With a '/' and the name of a service it is to be within the 255 bytes of a full name.
constexpr std::size_t kRobotNameBytesMax = 200;

std::optional<Error> apply(DemoOptions& options, std::string_view name, std::string_view value) {
  if (name == "--log") return read_text(options.log, name, value);
  if (name == "--map") return read_text(options.map, name, value);
  if (name == "--hub") return read_text(options.hub_url, name, value);
  if (name == "--speed")
    return read_number(options.speed, name, value, kPlaySpeedMin, kPlaySpeedMax);
  if (name == "--seconds")
    return read_number(options.seconds, name, value, 0.1, DemoOptions::kSecondsMax);
  if (name == "--ascii") options.glyphs = Glyphs::kAscii;
  if (name == "--utf8") options.glyphs = Glyphs::kUtf8;
  if (name == "--labs") options.labs = true;
  if (name == "--help" || name == "-h") options.help = true;
  if (name != "--robot") return std::nullopt;
  if (value.size() > kRobotNameBytesMax || !proto::valid_service_name(value)) {
    return Error{
        fmt::format("--robot takes a name of letters, digits, '.', '_' and '-', not '{}'", value)};
  }
  options.robot = value;
  return std::nullopt;
}

std::optional<Error> misplaced(const Argument& argument, DemoRole role) {
  constexpr unsigned kRoles[] = {kInAll, kInRobot, kInView};
  if ((argument.roles & kRoles[static_cast<std::size_t>(role)]) != 0) return std::nullopt;
  if (role == DemoRole::kAll) {
    return Error{
        fmt::format("{} is for one part of the demo: say 'robot' or 'view' first, or leave it out",
                    argument.name)};
  }
  if (argument.roles == kInAll) {
    return Error{
        fmt::format("{} is for the whole demo; leave 'robot' or 'view' out", argument.name)};
  }
  return Error{
      role == DemoRole::kView
          ? fmt::format("{} is the robot's; give it to 'gimnet-demo robot'", argument.name)
          : fmt::format("{} is the viewer's; give it to 'gimnet-demo view'", argument.name)};
}

std::optional<Error> contradiction(const std::vector<std::string_view>& given) {
  const auto has = [&](std::string_view name) {
    return std::find(given.begin(), given.end(), name) != given.end();
  };
  if (has("--log") && has("--map"))
    return Error{"--log and --map exclude each other: a log brings its own world; leave one out"};
  if (has("--speed") && !has("--log"))
    return Error{"--speed is the speed of a log; add --log FILE, or leave it out"};
  for (const std::string_view name : {"--log", "--map", "--robot"}) {
    if (has("--labs") && has(name))
      return Error{fmt::format("--labs brings its own machines; leave {} out", name)};
  }
  if (has("--ascii") && has("--utf8"))
    return Error{"--ascii and --utf8 exclude each other; leave one out"};
  return std::nullopt;
}

}  // namespace

std::string_view usage_text() { return kUsage; }

Result<DemoOptions> parse_options(std::span<const char* const> arguments) {
  DemoOptions options;
  std::vector<std::string_view> given;
  std::size_t index = 0;
  if (!arguments.empty()) {
    const std::string_view first = arguments.front();
    if (first == "robot" || first == "view") {
      options.role = first == "robot" ? DemoRole::kRobot : DemoRole::kView;
      index = 1;
    }
  }
  for (; index < arguments.size(); ++index) {
    const std::string_view word = arguments[index];
    const std::size_t equals = word.starts_with("--") ? word.find('=') : std::string_view::npos;
    const std::string_view name = word.substr(0, equals);
    const auto* known =
        std::find_if(std::begin(kArguments), std::end(kArguments),
                     [&](const Argument& argument) { return argument.name == name; });
    if (known == std::end(kArguments)) {
      return Error{fmt::format("there is no argument '{}'; 'gimnet-demo --help' lists them", word)};
    }
    if (std::find(given.begin(), given.end(), name) != given.end()) {
      return Error{fmt::format("{} is given twice; leave one out", name)};
    }
    given.push_back(name);
    std::string_view value;
    if (equals != std::string_view::npos) {
      if (!known->takes_value)
        return Error{fmt::format("{} takes no value; write only {}", name, name)};
      value = word.substr(equals + 1);
    } else if (known->takes_value) {
      if (++index >= arguments.size())
        return Error{fmt::format("{} needs a value behind it", name)};
      value = arguments[index];
    }
    if (const std::optional<Error> error = misplaced(*known, options.role)) return *error;
    if (const std::optional<Error> error = apply(options, name, value)) return *error;
    if (options.help) return options;
  }
  if (const std::optional<Error> error = contradiction(given)) return *error;
  return options;
}

}  // namespace gimnet::demo
