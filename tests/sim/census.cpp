#include "tests/sim/census.hpp"

#include <cstdio>
#include <string_view>

namespace gimnet::sim {
namespace {

constexpr std::array<std::string_view, kHappenings> kNames = {"joined",
                                                              "name collision",
                                                              "name taken over",
                                                              "name changed",
                                                              "bad name",
                                                              "wrong role",
                                                              "came back",
                                                              "came back replacing",
                                                              "token altered",
                                                              "token of the past",
                                                              "token shown twice",
                                                              "token expired",
                                                              "token of another identity",
                                                              "restored after grace",
                                                              "restored after restart",
                                                              "last goodbye told",
                                                              "grace expired",
                                                              "grace put off",
                                                              "goodbye",
                                                              "crash",
                                                              "vanished",
                                                              "short hang",
                                                              "silent",
                                                              "hello of the dead",
                                                              "frames lost with connection",
                                                              "misconduct named",
                                                              "misconduct nameless",
                                                              "gone with connection",
                                                              "hub full",
                                                              "crowd full",
                                                              "crowd made room",
                                                              "room made",
                                                              "declarer made room",
                                                              "services limit",
                                                              "subscriptions limit",
                                                              "requests limit",
                                                              "page continued",
                                                              "refused request",
                                                              "unknown operation",
                                                              "garbled request",
                                                              "slot reused",
                                                              "index near the end",
                                                              "ids forgotten",
                                                              "group given back",
                                                              "newcomer waits for returns",
                                                              "state kept",
                                                              "state not kept",
                                                              "service moved",
                                                              "provider changed",
                                                              "service withdrawn",
                                                              "service away",
                                                              "subscribed before service",
                                                              "undeclared dropped",
                                                              "name registered",
                                                              "name unregistered",
                                                              "watch snapshot",
                                                              "watch snapshot by pattern",
                                                              "watch change",
                                                              "watch began again",
                                                              "watch went on",
                                                              "watches limit",
                                                              "event skipped away",
                                                              "request of replaced connection",
                                                              "names rate",
                                                              "services rate",
                                                              "subscriptions rate",
                                                              "rate over",
                                                              "asked too often in vain",
                                                              "change denied",
                                                              "kicked",
                                                              "kicked away",
                                                              "kicked token refused",
                                                              "renumbered",
                                                              "renumbered away",
                                                              "renumbered came back",
                                                              "renumbered to taken",
                                                              "renumbered to one who may come back",
                                                              "renumbering not kept",
                                                              "renumbered while some may come back",
                                                              "named by former id",
                                                              "configuration changed",
                                                              "configuration refused",
                                                              "service latest",
                                                              "service sync",
                                                              "service retained",
                                                              "delivery refused",
                                                              "pace taken up",
                                                              "pace changed",
                                                              "pace given up",
                                                              "window full",
                                                              "not due",
                                                              "held replaced",
                                                              "latest replaced",
                                                              "oldest dropped",
                                                              "paced message lost",
                                                              "paced message missed",
                                                              "counted anew",
                                                              "moves told again",
                                                              "told later",
                                                              "event missed",
                                                              "missed told again",
                                                              "credited",
                                                              "credit delayed",
                                                              "credit too late",
                                                              "last message first",
                                                              "start across shards",
                                                              "unicast delivered",
                                                              "unicast across shards",
                                                              "unicast to departed",
                                                              "unicast waited for return",
                                                              "unicast dropped away",
                                                              "group delivered",
                                                              "group of another",
                                                              "group of nobody",
                                                              "service frame delivered",
                                                              "service frame refused",
                                                              "frame stalled",
                                                              "connection clogged",
                                                              "shard paused",
                                                              "conductor paused",
                                                              "slow reader",
                                                              "hub killed",
                                                              "drain asked for",
                                                              "drain by signal",
                                                              "refused draining",
                                                              "told draining",
                                                              "drained in life",
                                                              "drained",
                                                              "garbage freed"};

}  // namespace

std::string Census::table() const {
  std::string text;
  for (std::size_t i = 0; i < kHappenings; ++i) {
    char number[32];
    std::snprintf(number, sizeof number, "%12llu  ", static_cast<unsigned long long>(counts_[i]));
    text += number;
    text += kNames[i];
    text += '\n';
  }
  return text;
}

std::vector<std::string> Census::missing() const {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < kHappenings; ++i) {
    if (counts_[i] == 0) names.emplace_back(kNames[i]);
  }
  return names;
}

}  // namespace gimnet::sim
