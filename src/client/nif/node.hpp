#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/nif/inbound.hpp"
#include "client/nif/node_parts.hpp"
#include "client/nif/node_thread.hpp"

namespace gimnet::nif {

/// One node: a connection to a hub, made again when it breaks, with its library thread. It gives
/// what comes to the parts that it is about.
/// Thread safety: public functions from any thread.
class Node final : private InboundHost {
 public:
  /// Dials, shakes hands, starts the thread. Errors: as nif_connect().
  [[nodiscard]] static Result<std::unique_ptr<Node>, Failure> connect(Options options);
  /// REQUIRES: close() was called, and no other thread is inside.
  ~Node();

  /// A node has one owner at first, and is destroyed when the last one drops it.
  void add_owner() { owners_.fetch_add(1); }
  void drop() {
    if (owners_.fetch_sub(1) == 1) delete this;
  }

  [[nodiscard]] Outbound& outbound() { return parts_.outbound; }
  [[nodiscard]] ReceiveQueue& received() { return parts_.received; }
  [[nodiscard]] RequestTable& requests() { return parts_.requests; }
  [[nodiscard]] Declarations& declarations() { return parts_.declarations; }
  [[nodiscard]] WatchTable& watches() { return parts_.watches; }
  [[nodiscard]] NameCache& names() { return parts_.names; }
  [[nodiscard]] CreditBook& credits() { return parts_.credits; }
  [[nodiscard]] HubClock& clock() { return parts_.clock; }
  [[nodiscard]] NodeStatus& record() { return parts_.record; }
  [[nodiscard]] NodeThread& thread() { return thread_; }
  [[nodiscard]] const Options& options() const { return parts_.options; }
  /// As NodeStatus::set_name(). The library's thread declares the services anew.
  void set_name(const std::string& name, std::vector<std::byte> token);

  [[nodiscard]] std::uint32_t id() const {
    return parts_.id.load(std::memory_order_relaxed);  // a number by itself
  }
  [[nodiscard]] nif_info info();
  [[nodiscard]] nif_counters counters();
  /// Sends as nif_send() does. `tag` names the message to Outbound::give_up().
  [[nodiscard]] nif_status send(const nif_outgoing& message, std::int32_t timeout_ms,
                                std::uint64_t tag = 0);
  [[nodiscard]] nif_status ping_hub(HubClock::Measurement& measured, Deadline deadline);

  /// Makes every waiting call leave with NIF_CLOSED, now and from now on.
  void begin_close();
  /// Writes what waits, says GOODBYE, ends the thread. REQUIRES: begin_close() was called.
  void close();

 private:
  explicit Node(Options options);

  // InboundHost, on the library's thread.
  [[nodiscard]] bool on_flow(const proto::flow::Message& message) override;
  [[nodiscard]] std::vector<Item> on_answer(proto::Kind kind,
                                            const proto::ControlView& answer) override;
  bool on_service_moved(const proto::ns::ServiceMoved& event) override;
  [[nodiscard]] bool on_watch_events(const proto::ns::WatchEvents& events) override;
  [[nodiscard]] bool is_own_service(const std::string& name) override {
    return parts_.record.is_own_service(name);
  }
  void on_taken(std::uint32_t from, const proto::Taken& taken) override;
  bool on_report(const proto::Report& report) override;
  [[nodiscard]] std::optional<ReportedMessages::Start> message_of(
      const proto::Report& report) override;
  void send_taken(std::uint32_t to, const proto::Taken& taken) override;
  [[nodiscard]] std::uint32_t epoch_for(std::uint32_t group) override {
    return parts_.credits.epoch_for(group);
  }
  [[nodiscard]] bool may_wait(std::uint32_t group, std::size_t bytes) override {
    return parts_.declarations.may_wait(GroupId{group}, bytes);
  }
  void on_message_lost(std::uint32_t group) override {
    parts_.credits.take(group, epoch_for(group), 1, false);
  }
  void deliver(std::span<const Item> items) override;

  NodeParts parts_;
  NodeThread thread_;
  std::atomic<std::uint32_t> owners_{1};
};

}  // namespace gimnet::nif
