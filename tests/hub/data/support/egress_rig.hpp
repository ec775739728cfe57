#pragma once

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "hub/data/egress/gather_writer.hpp"
#include "hub/data/egress/outbox.hpp"
#include "proto/frame/fragment_header.hpp"
#include "tests/support/memory_stream.hpp"

namespace gimnet::hub::testing {

/// Keeps the words of an outbox to its senders, as text: "pause 7.1", "hold 7.1".
struct FakeSignals final : SenderSignals {
  void pause(NodeId sender, const proto::flow::Target&) override { say("pause ", sender); }
  void resume(NodeId sender, const proto::flow::Target&) override { say("resume ", sender); }
  void hold(NodeId sender) override { say("hold ", sender); }
  void release(NodeId sender) override { say("release ", sender); }
  void say(const char* what, NodeId sender) {
    said.push_back(what + std::to_string(index_of(sender)));
  }
  std::vector<std::string> take() { return std::exchange(said, {}); }
  std::vector<std::string> said;
};

struct TestFrame {
  proto::Kind kind = proto::Kind::unicast;
  std::uint8_t flags = 0;
  std::uint8_t lane = 1;
  std::uint32_t src = 1;
  std::uint32_t dst = 99;
};

/// The parts that all outboxes of a shard share, and frames in a slab as a read leaves them there.
class EgressRig {
 public:
  explicit EgressRig(Limits given = {})
      : limits(given),
        budget(limits.budget_bytes),
        lease(budget),
        link_budget(limits.link_budget_bytes),
        link_lease(link_budget),
        pool(static_cast<std::uint32_t>(limits.frame_bytes), lease),
        pieces(lease),
        link_pieces(link_lease),
        drops(tally, limits.report_interval_ms, limits.reports),
        context{limits,    pool,          {{{lease, pieces}, {link_lease, link_pieces}}},
                tally,     drops,         signals,
                1'000'000, 1'000'000'000, HubId{7}} {}

  static std::vector<std::byte> bytes(const std::string& payload, const TestFrame& frame = {}) {
    proto::FrameHeader header;
    header.length = static_cast<std::uint32_t>(payload.size());
    const bool for_this_connection =
        frame.kind == proto::Kind::flow || frame.kind == proto::Kind::link;
    header.dst = for_this_connection ? 0 : 7u << 20 | frame.dst;
    header.src = 7u << 20 | frame.src;
    header.kind = frame.kind;
    header.flags = frame.flags;
    header.lane = frame.lane;
    std::vector<std::byte> all(header.frame_size());
    proto::store_header(all.data(), header);
    if (!payload.empty())
      std::memcpy(all.data() + proto::kHeaderSize, payload.data(), payload.size());
    return all;
  }
  /// Frames with one header, one behind the other in a slab.
  Run run(const std::vector<std::string>& payloads, const TestFrame& frame = {}) {
    std::vector<std::byte> all;
    for (const std::string& payload : payloads) {
      const auto one = bytes(payload, frame);
      all.insert(all.end(), one.begin(), one.end());
    }
    if (!slab_ || slab_->capacity - used_ < all.size()) {
      slab_ = pool.take_slab();
      used_ = 0;
    }
    std::byte* place = slab_->data + used_;
    std::memcpy(place, all.data(), all.size());
    used_ += static_cast<std::uint32_t>(all.size());
    accepted += payloads.size();
    return {slab_.share(), place, static_cast<std::uint32_t>(all.size()),
            static_cast<std::uint32_t>(payloads.size())};
  }
  void push(Outbox& outbox, const std::string& payload, const TestFrame& frame = {},
            bool fan_out = false) {
    const Run one = run({payload}, frame);
    outbox.push(one, one.header(), Handover{fan_out}, context);
  }
  void push_fragment(Outbox& outbox, std::uint32_t number, std::uint32_t offset,
                     std::uint32_t total, const std::string& payload, TestFrame frame = {}) {
    std::string all(proto::kFragmentHeaderSize, '\0');
    proto::store_fragment_header(reinterpret_cast<std::byte*>(all.data()), {number, offset, total});
    frame.flags |= proto::kFlagFragment;
    push(outbox, all + payload, frame);
  }
  [[nodiscard]] std::uint64_t dropped(proto::DropReason reason) const {
    return tally.dropped[static_cast<std::size_t>(reason)];
  }
  [[nodiscard]] bool ledger_exact() const {
    std::uint64_t all = tally.delivered + static_cast<std::uint64_t>(tally.queued);
    for (const std::uint64_t reason : tally.dropped) all += reason;
    return all == accepted;
  }

  Limits limits;
  Budget budget;
  BudgetLease lease;
  Budget link_budget;
  BudgetLease link_lease;
  BufferPool pool;
  PiecePool pieces;
  PiecePool link_pieces;
  Tally tally;
  DropBook drops;
  FakeSignals signals;
  EgressContext context;
  std::uint64_t accepted = 0;

 private:
  BufferRef slab_;
  std::uint32_t used_ = 0;
};

/// Bytes of the run's last frame, as a parser says.
inline std::uint32_t last_bytes_of(const Run& run) {
  Run last = run.share();
  while (last.frames > 1) last.skip_frame();
  return last.size;
}

/// An outbox, its writer and the far end of its connection.
struct TestConnection {
  explicit TestConnection(EgressRig& egress_rig) : rig(egress_rig) {
    auto pipe = make_memory_pipe();
    transport = std::move(pipe.first);
    peer = std::move(pipe.second);
  }
  ~TestConnection() {
    const Run partial = writer.take_partial();
    outbox.drop_all(proto::DropReason::link_lost, rig.context);
  }
  /// As the flusher does it.
  Flush flush(ResumeBuffer* resume = nullptr) {
    const Flush result = writer.flush(outbox, resume, *transport, rig.context);
    if (result == Flush::emptied) {
      outbox.on_emptied(rig.context);
    } else {
      outbox.settle(rig.context);
    }
    outbox.signal_room(rig.context);
    return result;
  }
  /// The payloads that arrived since the last call, of whole frames. Fragments show as
  /// "number:offset:payload".
  std::vector<std::string> take() {
    peer.read(stream);
    std::vector<std::string> texts;
    std::size_t begin = 0;
    while (stream.size() - begin >= proto::kHeaderSize) {
      const proto::FrameHeader header = proto::load_header(stream.data() + begin);
      if (stream.size() - begin < header.frame_size()) break;
      const auto* body = reinterpret_cast<const char*>(stream.data() + begin + proto::kHeaderSize);
      std::string text(body, header.length);
      if (header.has(proto::kFlagFragment)) {
        const auto fragment = proto::load_fragment_header(reinterpret_cast<const std::byte*>(body));
        text = std::to_string(fragment.message) + ":" + std::to_string(fragment.offset) + ":" +
               text.substr(proto::kFragmentHeaderSize);
      }
      texts.push_back(std::move(text));
      begin += header.frame_size();
    }
    stream.erase(stream.begin(), stream.begin() + static_cast<std::ptrdiff_t>(begin));
    return texts;
  }

  EgressRig& rig;
  std::unique_ptr<net::Stream> transport;
  MemoryPeer peer;
  Outbox outbox;
  GatherWriter writer;
  std::vector<std::byte> stream;
};

}  // namespace gimnet::hub::testing
