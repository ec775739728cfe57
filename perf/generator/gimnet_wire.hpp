#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "generator/wire.hpp"

namespace gimnet::perf {

/// A raw node of docs/protocol.md: opening, HELLO and WELCOME, frames, one service as the group,
/// keep-alive, and PAUSE and RESUME honoured. It asks for no resume. What the hub refuses ends the
/// program with the hub's own sentence.
class GimnetWire final : public Wire {
 public:
  void open(Client& client) override;
  void provide(Client& client) override;
  void subscribe(Client& client) override;
  [[nodiscard]] std::size_t take(Client& client, std::span<const std::byte> bytes) override;
  void keep_alive(Client& client) override;
  bool ask_for_ledger(Client& client) override;

 protected:
  [[nodiscard]] std::uint32_t node_id(const Client& client) const override {
    return sessions_[client.index()].node_id;
  }
  [[nodiscard]] std::uint32_t group_id() const override { return group_id_; }
  void take_other(Client& client, const proto::FrameHeader& header,
                  std::span<const std::byte> body) override;

 private:
  struct Session {
    std::uint32_t node_id = 0;
    std::uint32_t pings = 0;
    bool is_opened = false;  ///< the hub's opening was read
  };

  void take_link(Client& client, std::span<const std::byte> body);
  void take_answer(Client& client, std::span<const std::byte> body);
  void take_flow(Client& client, std::span<const std::byte> body);
  void take_statistics(std::span<const std::byte> body);
  void request(Client& client, proto::Kind kind, std::span<const std::byte> payload);

  std::vector<Session> sessions_;  ///< by index of the client
  std::uint32_t group_id_ = 0;
};

}  // namespace gimnet::perf
