#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/nif/message_assembler.hpp"
#include "client/nif/record_list.hpp"
#include "client/nif/reported_messages.hpp"
#include "client/nif/session_terms.hpp"
#include "client/nif/storage.hpp"
#include "proto/control/control_message.hpp"
#include "proto/control/link.hpp"
#include "proto/control/ns_watch.hpp"
#include "proto/frame/flow.hpp"
#include "proto/frame/frame_parser.hpp"
#include "proto/frame/report.hpp"
#include "proto/frame/taken.hpp"

namespace gimnet::nif {

/// The rest of the node, as the receiving half needs it. Called on the library's thread, with no
/// lock held.
class InboundHost {
 public:
  /// PING, PONG, PAUSE, RESUME, CONFIRM. False: it contradicts what was sent, the hub is wrong.
  [[nodiscard]] virtual bool on_flow(const proto::flow::Message& message) = 0;
  /// Returns the events that it leads to, which the program gets in its place; passes their
  /// references on.
  [[nodiscard]] virtual std::vector<Item> on_answer(proto::Kind kind,
                                                    const proto::ControlView& answer) = 0;
  /// False: it is nothing new to the program.
  [[nodiscard]] virtual bool on_service_moved(const proto::ns::ServiceMoved& event) = 0;
  /// True: the program is to have it.
  [[nodiscard]] virtual bool on_watch_events(const proto::ns::WatchEvents& events) = 0;
  /// It is the full name of a service of this node, and not the name of a node.
  [[nodiscard]] virtual bool is_own_service(const std::string& name) = 0;
  virtual void on_taken(std::uint32_t from, const proto::Taken& taken) = 0;
  /// True: the program did not ask for this report.
  virtual bool on_report(const proto::Report& report) = 0;
  /// The beginning of the message with a fragment header that the report is about, if it is known.
  [[nodiscard]] virtual std::optional<ReportedMessages::Start> message_of(
      const proto::Report& report) = 0;
  /// It may not go now; tell_taken_again() brings it.
  virtual void send_taken(std::uint32_t to, const proto::Taken& taken) = 0;
  /// The tag of a message of that group; 0: it does not count in a window.
  [[nodiscard]] virtual std::uint32_t epoch_for(std::uint32_t group) = 0;
  /// False: a message of that group with so many bytes is dropped, and told by a NIF_GAP later.
  [[nodiscard]] virtual bool may_wait(std::uint32_t group, std::size_t bytes) = 0;
  /// A message of that group ended of which the program gets nothing.
  virtual void on_message_lost(std::uint32_t group) = 0;
  /// Takes what was received, in order, and the references.
  virtual void deliver(std::span<const Item> items) = 0;

 protected:
  ~InboundHost() = default;
};

/// The receiving half of a node: bytes of the hub in, messages and events out. The hub is not
/// trusted: whatever it sends either is taken or ends the connection with a sentence. A frame that
/// another node wrote, or a REPORT, never ends the connection: if it cannot be read, it is dropped
/// and counted.
/// Thread safety: the library's thread; no sockets, no clocks. Memory: the read buffer, and
/// unfinished messages within the reassembly limits.
class Inbound {
 public:
  enum class Verdict : std::uint8_t {
    going,
    goodbye,    ///< the hub said GOODBYE: goodbye()
    malformed,  ///< fault() says what
  };

  Inbound(const proto::ReassemblyLimits& limits, InboundHost& host)
      : host_(host), assembler_(limits) {}
  ~Inbound();
  Inbound(const Inbound&) = delete;
  Inbound& operator=(const Inbound&) = delete;

  /// A new connection; what its handshake left over is to be given to take() next.
  void begin(const SessionTerms& session);

  /// Room for the next bytes, at least one frame's worth. Empty: no memory. Valid until: take().
  [[nodiscard]] std::span<std::byte> space();
  /// When bytes were read from the socket.
  struct Arrival {
    std::int64_t wall_ns = 0;    ///< wall_now_ns(), for the program
    std::int64_t steady_ns = 0;  ///< steady_now_ns(), for intervals
  };
  /// `bytes` were written to space().
  [[nodiscard]] Verdict take(std::size_t bytes, const Arrival& arrival);

  /// TAKENs to that node may go again, which the hub had paused.
  void tell_taken_again(NodeId sender) { tell_taken(assembler_.notices_again(sender)); }

  /// Data frames of this epoch taken so far.
  [[nodiscard]] std::uint64_t taken() const { return taken_; }
  /// A quarter of the hub's resume buffer was taken since confirmed().
  [[nodiscard]] bool confirm_due() const { return unconfirmed_bytes_ >= confirm_bytes_; }
  void confirmed() { unconfirmed_bytes_ = 0; }

  [[nodiscard]] const proto::Goodbye& goodbye() const { return goodbye_; }
  [[nodiscard]] const std::string& fault() const { return fault_; }

  struct Counts {
    std::uint64_t frames = 0;
    std::uint64_t messages = 0;
    std::uint64_t messages_lost = 0;
    std::uint64_t gaps = 0;
    std::uint64_t ignored = 0;
    std::uint64_t unreadable = 0;  ///< frames of other nodes, and REPORTs
  };
  [[nodiscard]] const Counts& counts() const { return counts_; }

 private:
  [[nodiscard]] Verdict malformed(std::string why);
  [[nodiscard]] Verdict take_run(const proto::RunView& run);
  void drop_unreadable(const std::byte* frame);
  void drop_report();
  [[nodiscard]] Verdict take_frame(const proto::FrameView& view, const std::byte* frame);
  [[nodiscard]] Verdict take_data(const proto::FrameView& view, const std::byte* frame);
  [[nodiscard]] Verdict take_message(const proto::FrameView& view, const std::byte* frame);
  [[nodiscard]] Verdict take_fragment(const proto::FrameView& view, const std::byte* frame);
  [[nodiscard]] Verdict take_flow(const proto::FrameView& view);
  [[nodiscard]] Verdict take_link(const proto::FrameView& view);
  [[nodiscard]] Verdict take_names(const proto::FrameView& view);
  [[nodiscard]] Verdict take_event(const proto::ControlView& event,
                                   std::span<const std::byte> payload);
  [[nodiscard]] Verdict take_watch_events(std::span<const std::byte> payload);
  [[nodiscard]] Verdict take_name_lost(std::span<const std::byte> payload);
  void take_report(const proto::FrameView& view);
  [[nodiscard]] bool may_wait(const proto::FrameHeader& header, std::size_t bytes);
  void add_frame(const proto::FrameView& view, const std::byte* frame);
  /// A message whose payload has memory of its own.
  void add_whole(const proto::FrameView& view, const std::byte* frame, ByteBuffer payload);
  void add_record(Record* record, std::size_t bytes);
  void add_events(std::span<const Item> events);
  [[nodiscard]] std::uint32_t epoch_of(const proto::FrameHeader& header);
  void add_gap(std::uint32_t from, std::uint64_t count, proto::DropReason reason);
  /// The first fragment came of a message that is larger than this end takes.
  void add_too_large(const proto::FrameView& view, const std::byte* frame);
  void add_moved(const proto::ns::ServiceMoved& event);
  void deliver();
  void tell_taken(const std::vector<MessageAssembler::Notice>& notices);

  InboundHost& host_;
  MessageAssembler assembler_;
  Slab* slab_ = nullptr;
  std::size_t filled_ = 0;
  std::size_t parsed_ = 0;
  std::size_t charged_ = 0;          ///< up to here slab_ is in the size of items
  std::size_t uncharged_bytes_ = 0;  ///< of former slabs that items keep
  std::uint32_t id_ = 0;
  std::uint64_t taken_ = 0;
  std::uint64_t unconfirmed_bytes_ = 0;
  std::uint64_t confirm_bytes_ = UINT64_MAX;
  Arrival arrival_;
  std::vector<Item> batch_;
  proto::Goodbye goodbye_;
  std::string fault_;
  Counts counts_;
};

}  // namespace gimnet::nif
