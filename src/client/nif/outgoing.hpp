#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/ids.hpp"
#include "client/nif/error.hpp"
#include "client/nif/hub_clock.hpp"
#include "gimnet/nif.h"
#include "proto/frame/extensions.hpp"
#include "proto/frame/frame_builder.hpp"

namespace gimnet::nif {

/// A nif_outgoing that was checked, in the form in which frames are made of it. Refers to the
/// caller's payload. Thread safety: one thread.
class Outgoing {
 public:
  /// An AGE begins now, in the hub's time as `clock` knows it; nullptr: in the own time.
  /// Errors: NIF_BAD_ARGUMENT, NIF_TOO_LARGE. REQUIRES: `given` and what it points to outlive this.
  [[nodiscard]] std::optional<Failure> read(const nif_outgoing& given, HubClock* clock = nullptr);

  [[nodiscard]] std::uint32_t size() const { return size_; }
  /// Without the GIMI header that a message with a key begins with.
  [[nodiscard]] std::uint32_t application_bytes();
  /// Frame parts without fragment and payload size. Valid until: this goes.
  [[nodiscard]] const proto::FrameParts& parts() const { return parts_; }
  /// Kind, lane and destination; 0 for LIST, as its recipients see it.
  [[nodiscard]] std::uint64_t stream() const { return stream_; }
  /// LATEST, and small enough to be replaced whole in the send queue.
  [[nodiscard]] bool replaceable() const;
  [[nodiscard]] bool more() const { return more_; }
  /// It does not wait for a connection.
  [[nodiscard]] bool not_while_away() const { return not_while_away_; }
  [[nodiscard]] bool is_group() const { return parts_.header.kind == proto::Kind::group; }
  /// It is for that destination now.
  void redirect(std::uint32_t dst);
  [[nodiscard]] bool reported() const { return parts_.header.has(proto::kFlagReport); }

  /// By which give_up() of Outbound finds it; 0: it does not.
  [[nodiscard]] std::uint64_t tag() const { return tag_; }
  void set_tag(std::uint64_t tag) { tag_ = tag; }

  /// The same message with a copy of the payload from `offset` on; nothing before that can be
  /// written. May throw std::bad_alloc.
  [[nodiscard]] std::unique_ptr<Outgoing> copy_rest(std::uint32_t offset);
  /// Bytes of such a copy.
  [[nodiscard]] std::size_t rest_bytes() const { return rest_.size(); }
  /// Its sender waits without a limit: nothing of it is held.
  [[nodiscard]] bool patient() const { return patient_; }
  void set_patient(bool patient) { patient_ = patient; }

  /// Writes one frame with the payload bytes from `offset` on; `frame` has exactly its size.
  void write_frame(std::span<std::byte> frame, std::uint32_t src,
                   std::optional<proto::FragmentHeader> fragment, std::uint32_t offset,
                   std::uint32_t piece_size, bool report);
  /// Writes the key, if there is one, and the first bytes of the payload behind it. REQUIRES: it
  /// has as many.
  void write_start(std::span<std::byte> start);
  /// The whole payload. REQUIRES: `to` has its size.
  void copy_to(std::span<std::byte> to) {
    copy_payload(to.data(), 0, static_cast<std::uint32_t>(to.size()));
  }

 private:
  [[nodiscard]] std::optional<Failure> read_address(const nif_outgoing& message);
  [[nodiscard]] std::optional<Failure> read_payload(const nif_outgoing& message);
  void read_extensions(const nif_outgoing& message, HubClock* clock);
  void copy_payload(std::byte* to, std::uint32_t offset, std::uint32_t bytes);

  proto::FrameParts parts_;
  std::vector<NodeId> recipients_;
  std::array<std::byte, 256> extensions_;
  std::span<const nif_bytes> payload_;
  std::uint32_t size_ = 0;
  std::uint64_t stream_ = 0;
  std::uint64_t tag_ = 0;
  bool more_ = false;
  bool not_while_away_ = false;
  bool patient_ = true;
  std::vector<std::byte> rest_;  ///< of a copy
  nif_bytes rest_part_{};
  std::size_t part_ = 0;         ///< where the last copy ended
  std::size_t part_offset_ = 0;  ///< payload bytes before that part
};

}  // namespace gimnet::nif
