#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hub/control/waiting_room.hpp"
#include "tests/hub/control/support/peer.hpp"

namespace gimnet::hub {

/// A waiting room, peers in it, and a judge who admits all but one name.
class WaitingRoomTest : public ::testing::Test {
 protected:
  WaitingRoomTest()
      : room_(
            limits_,
            [this](Stranger& stranger, const proto::Hello& hello) {
              return judge(stranger, hello);
            },
            refusals_) {}

  std::optional<proto::Goodbye> judge(Stranger& stranger, const proto::Hello& hello) {
    hellos_.push_back(hello);
    if (hello.name == "unwelcome") return proto::Goodbye{proto::GoodbyeCode::name_taken, "taken"};
    admitted_.push_back(std::move(stranger.transport));
    return std::nullopt;
  }
  Peer& enter(std::chrono::milliseconds now = std::chrono::milliseconds{0}) {
    peers_.push_back(std::make_unique<Peer>());
    room_.enter(peers_.back()->take_stranger(), now);
    return *peers_.back();
  }
  Peer& enter_from(const std::string& address,
                   std::chrono::milliseconds now = std::chrono::milliseconds{0}) {
    peers_.push_back(std::make_unique<Peer>());
    Stranger stranger = peers_.back()->take_stranger();
    stranger.peer = PeerInfo{"tcp", address + ":" + std::to_string(40'000 + peers_.size())};
    room_.enter(std::move(stranger), now);
    return *peers_.back();
  }
  static bool timed_out(Peer& peer) {
    const auto goodbye = peer.receive_goodbye();
    return goodbye && goodbye->code == proto::GoodbyeCode::hello_timeout;
  }
  struct Standing {
    bool may_administer = false;
    bool on_reserve = false;
  };
  Peer& enter_as(const Standing& standing) {
    peers_.push_back(std::make_unique<Peer>());
    Stranger stranger = peers_.back()->take_stranger();
    stranger.rights.administer = standing.may_administer;
    stranger.on_reserve = standing.on_reserve;
    room_.enter(std::move(stranger), std::chrono::milliseconds{0});
    return *peers_.back();
  }
  void serve(std::chrono::milliseconds now = std::chrono::milliseconds{0}) {
    while (room_.serve(now)) {
    }
  }
  static proto::Hello hello(const std::string& name) {
    proto::Hello result;
    result.name = name;
    return result;
  }

  Limits limits_;
  RefusalCounters refusals_;
  std::vector<proto::Hello> hellos_;
  std::vector<std::unique_ptr<net::Stream>> admitted_;
  std::vector<std::unique_ptr<Peer>> peers_;
  WaitingRoom room_;
};

}  // namespace gimnet::hub
