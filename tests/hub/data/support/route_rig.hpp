#pragma once

#include <memory>
#include <string>
#include <vector>

#include "hub/data/route/router.hpp"
#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub::testing {

/// The routing side of shard 0 of a hub with two shards: recipients without connections, and the
/// other shard's mailbox.
class RouteRig {
 public:
  explicit RouteRig(Limits limits = {})
      : egress(limits),
        mailbox_here(2, {limits.mailbox_entries, limits.mailbox_bytes}, waker),
        mailbox_there(2, {limits.mailbox_entries, limits.mailbox_bytes}, waker),
        fanout(ShardIndex{0}, {&mailbox_here, &mailbox_there}, recipients, egress.context,
               {nodes, groups}),
        pacer(fanout),
        retained(groups, fanout, pacer, retained_budget),
        router(HubId{7}, {nodes, groups, routes, fanout, pacer, retained}) {}
  ~RouteRig() {
    for (const auto& recipient : recipients_made) {
      recipient->outbox.drop_all(proto::DropReason::link_lost, egress.context);
      pacer.forget(*recipient);
    }
    take_mail();
  }

  Recipient& add_here(std::uint32_t index) {
    auto recipient = std::make_unique<Recipient>();
    recipient->node = make_id<NodeId>(HubId{7}, index);
    recipient->slot = ConnectionSlot{index};
    recipient->generation = index;
    recipient->connected = true;
    recipients.put(*recipient);
    nodes.publish(index, {ShardIndex{0}, recipient->slot, recipient->generation});
    recipients_made.push_back(std::move(recipient));
    return *recipients_made.back();
  }
  void add_there(std::uint32_t index) {
    nodes.publish(index, {ShardIndex{1}, ConnectionSlot{index}, index});
  }

  void publish_group(std::uint32_t index, std::uint32_t provider,
                     const std::vector<std::uint32_t>& here,
                     const std::vector<std::uint32_t>& there, bool accepts = false) {
    members.accepts = accepts;
    members.provider = make_id<NodeId>(HubId{7}, provider);
    members.provider_place = nodes.find(provider);
    members.by_shard.assign(2, {});
    for (const std::uint32_t member : here)
      members.by_shard[0].put({ConnectionSlot{member}, member});
    for (const std::uint32_t member : there)
      members.by_shard[1].put({ConnectionSlot{member}, member});
    static_cast<void>(groups.exchange(index, &members));
  }

  /// A run of frames with that destination from node 1, counted as taken in.
  void route(std::uint32_t dst, const std::vector<std::string>& payloads,
             const TestFrame& frame = {}) {
    hub::Run run = make_run(dst, payloads, frame);
    route(run);
    fanout.post_all();
  }
  void route(const hub::Run& run) {
    router.route(run.buffer, {run.bytes, run.size, run.frames, last_bytes_of(run)});
  }
  hub::Run make_run(std::uint32_t dst, const std::vector<std::string>& payloads,
                    const TestFrame& frame = {}) {
    hub::Run run = egress.run(payloads, frame);
    auto* bytes = const_cast<std::byte*>(run.bytes);
    for (std::uint32_t done = 0; done < run.size;) {
      std::memcpy(bytes + done + 4, &dst, sizeof dst);
      done += static_cast<std::uint32_t>(proto::load_header(bytes + done).frame_size());
    }
    return run;
  }
  /// Takes the other shard's mail: the number of frames of each entry.
  std::vector<std::uint32_t> take_mail() {
    std::vector<std::uint32_t> entries;
    mailbox_there.drain(
        100'000, [] {},
        [&](const Mail& mail) {
          if (mail.kind != MailKind::frames) return;
          entries.push_back(mail.frames);
          BufferPool::end_loan(mail.lent);
        });
    return entries;
  }
  [[nodiscard]] bool ledger_exact() const {
    std::uint64_t all = egress.tally.delivered + static_cast<std::uint64_t>(egress.tally.queued);
    for (const std::uint64_t reason : egress.tally.dropped) all += reason;
    return all == egress.accepted + egress.tally.copies;
  }

  EgressRig egress;
  Waker waker;
  NodeTable nodes;
  GroupTable groups;
  RouteTable routes;
  RecipientTable recipients;
  Mailbox mailbox_here;
  Mailbox mailbox_there;
  Fanout fanout;
  Pacer pacer;
  Budget retained_budget{64 << 20};
  RetainedMessages retained;
  Router router;
  GroupMembers members;
  std::vector<std::unique_ptr<Recipient>> recipients_made;
};

}  // namespace gimnet::hub::testing
