#pragma once

#include <array>
#include <string_view>
#include <utility>

#include "tools/gimnet/options.hpp"

namespace CLI {
class App;
class Validator;
}  // namespace CLI

namespace gimnet::tool {

/// All commands, by the words that name them.
inline constexpr std::array<std::pair<std::string_view, Command>, 13> kCommands{
    {{"send", Command::send},
     {"recv", Command::recv},
     {"pub", Command::pub},
     {"echo", Command::echo},
     {"hz", Command::hz},
     {"bw", Command::bw},
     {"ping", Command::ping},
     {"nodes", Command::nodes},
     {"services", Command::services},
     {"watch", Command::watch},
     {"status", Command::status},
     {"impair", Command::impair},
     {"ctl", Command::ctl}}};

/// Declares every command and option; parsing writes to `options`, which must outlive `app`. Each
/// option's description says its unit, range and default: it is what a wrong value is answered
/// with.
void add_commands(CLI::App& app, Options& options);

/// An empty word is a mistake of a script, not a default.
[[nodiscard]] const CLI::Validator& not_empty();

}  // namespace gimnet::tool
