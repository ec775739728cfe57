#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "hub/control/shard_proxy.hpp"
#include "hub/shard/control_frame.hpp"

namespace gimnet::hub {

/// Shards that only write down what they are told.
class FakeShards final : public ShardProxy {
 public:
  explicit FakeShards(std::size_t count) : count_(count) {}

  struct Sent {
    ShardIndex shard;
    ShardCommand command;
  };
  /// A TellCommand is written down as what it means: one SendControlCommand for each session.
  void send(ShardIndex shard, ShardCommand command) override {
    if (auto* tell = std::get_if<TellCommand>(&command)) {
      if (on_tell) return on_tell(std::move(*tell));
      told.push_back(tell->to.size());
      for (const TellCommand::To& to : tell->to) {
        set_destination(tell->frame, to.node);
        send(shard, SendControlCommand{to.session, 0, tell->frame, 0, {}, true});
      }
      return;
    }
    if (on_send) on_send(command);
    sent.push_back({shard, std::move(command)});
  }
  [[nodiscard]] std::size_t shards() const override { return count_; }

  /// All commands of one kind, in order.
  template <class Command>
  [[nodiscard]] std::vector<const Command*> all() const {
    std::vector<const Command*> found;
    for (const Sent& each : sent) {
      if (const auto* command = std::get_if<Command>(&each.command)) found.push_back(command);
    }
    return found;
  }

  std::vector<Sent> sent;
  std::vector<std::size_t> told;  ///< sessions of each TellCommand
  std::function<void(const ShardCommand&)> on_send;
  std::function<void(TellCommand)> on_tell;  ///< takes these instead

 private:
  const std::size_t count_;
};

}  // namespace gimnet::hub
