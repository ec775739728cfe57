#include "tools/gimnet/help_format.hpp"

#include <CLI/CLI.hpp>
#include <sstream>
#include <string>

namespace gimnet::tool {
namespace {

class HelpFormat final : public CLI::Formatter {
 public:
  std::string make_subcommand(const CLI::App* command) const override {
    const std::string about = command->get_description();
    std::ostringstream line;
    CLI::detail::format_help(line, command->get_display_name(true),
                             about.substr(0, about.find('\n')), get_column_width());
    return line.str();
  }

  std::string make_option_opts(const CLI::Option* option) const override {
    const std::string type = option->get_type_name();  // "UINT:UINT in [1 - 64]"; "" of a flag
    // What the command line takes in a certain place says its own name.
    if (type.empty() || option->get_positional()) return "";
    const bool whole = type.starts_with("UINT") || type.starts_with("INT");
    const char* what = whole ? " N" : type.starts_with("FLOAT") ? " X" : " WORD";
    return option->get_required() ? std::string(what) + " (required)" : what;
  }
};

}  // namespace

std::shared_ptr<CLI::FormatterBase> help_format() { return std::make_shared<HelpFormat>(); }

}  // namespace gimnet::tool
