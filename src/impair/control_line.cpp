#include "impair/control_line.hpp"

#include <span>
#include <vector>

#include "impair/delayed_channel.hpp"

namespace gimnet::impair {
namespace {

std::vector<std::string_view> words_of(std::string_view line) {
  constexpr std::string_view kBlank = " \t\r";
  std::vector<std::string_view> words;
  for (;;) {
    const std::size_t begin = line.find_first_not_of(kBlank);
    if (begin == std::string_view::npos) return words;
    line.remove_prefix(begin);
    words.push_back(line.substr(0, line.find_first_of(kBlank)));
    line.remove_prefix(words.back().size());
  }
}

std::string error(const std::string& sentence) { return "error: " + sentence; }

std::string stall(FaultProxy& proxy, std::span<const std::string_view> words) {
  Way way = Way::both;
  if (!words.empty() && (words[0] == "up" || words[0] == "down")) {
    way = words[0] == "up" ? Way::up : Way::down;
    words = words.subspan(1);
  }
  if (words.size() > 1) return error("stall takes [up|down] [TIME]");
  std::int64_t duration_ns = DelayedChannel::kNever;
  if (!words.empty()) {
    const auto parsed = parse_duration(words[0]);
    if (!parsed) return error(parsed.error().sentence);
    duration_ns = *parsed;
  }
  proxy.stall(way, duration_ns);
  return "ok";
}

std::string status(const FaultProxy& proxy) {
  const Relayed relayed = proxy.relayed();
  std::string text = "{";
  const auto add = [&text](std::string_view name, std::uint64_t value) {
    text += (text.size() > 1 ? ",\"" : "\"") + std::string(name) + "\":" + std::to_string(value);
  };
  add("connections", relayed.connections);
  add("accepted", relayed.accepted);
  add("refused", relayed.refused);
  add("cut", relayed.cut);
  add("stalls", relayed.stalls);
  add("up_bytes", relayed.up_bytes);
  add("down_bytes", relayed.down_bytes);
  return text + "}";
}

/// True: it was one of the words that stand alone.
bool did_plain_word(FaultProxy& proxy, std::string_view word) {
  if (word == "go") {
    proxy.go();
  } else if (word == "cut") {
    proxy.cut();
  } else if (word == "refuse" || word == "accept") {
    proxy.refuse(word == "refuse");
  } else {
    return false;
  }
  return true;
}

}  // namespace

std::string obey(FaultProxy& proxy, std::string_view line) {
  const std::vector<std::string_view> words = words_of(line);
  if (words.empty()) return "ok";
  if (words[0] == "stall") return stall(proxy, std::span(words).subspan(1));
  if (words.size() == 1 && words[0] == "status") return status(proxy);
  if (words.size() == 1 && did_plain_word(proxy, words[0])) return "ok";
  if (words.size() != 2) {
    return error(
        "'" + std::string(line) +
        "' is no order: give stall [up|down] [TIME], go, cut, refuse, accept, status, or a "
        "setting and its value (" +
        std::string(kSettingNames) + ")");
  }
  const auto changed = change_setting(proxy.impairment(), words[0], words[1]);
  if (!changed) return error(changed.error().sentence);
  proxy.change(*changed);
  return "ok";
}

}  // namespace gimnet::impair
