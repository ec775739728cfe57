#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "net/stream.hpp"

// A toy of a stream that encrypts: the proof that hub and library take such a one.

namespace gimnet::net {

/// Records of 16 bytes: a count of 0 to 15, and as many bytes of payload, all of them disguised by
/// xor. A record of count 0 is the stream's own.
class ToyCode {
 public:
  static constexpr std::size_t kRecord = 16;
  static constexpr std::size_t kPayload = kRecord - 1;

  /// The records of these bytes.
  [[nodiscard]] static std::vector<std::byte> encode(std::span<const std::byte> bytes);
  [[nodiscard]] static std::array<std::byte, kRecord> own_record();

  /// Takes bytes of records, however they are split, and appends their payload. Returns how many
  /// records ended.
  std::size_t decode(std::span<const std::byte> bytes, std::vector<std::byte>& plain);
  /// A record was begun.
  [[nodiscard]] bool in_record() const { return begun_ != 0; }

 private:
  std::array<std::byte, kRecord> record_{};
  std::size_t begun_ = 0;
};

/// True: the tests run over toy streams (the variable GIMNET_TEST_STREAM is `toy`).
[[nodiscard]] bool toy_streams_wanted();

/// A stream of such records over another stream. It gives whole records only; a record that the
/// kernel took in part is finished before anything else. It answers every 64 records that it reads
/// with one of its own, as a real one may. Thread safety: as Stream, without a lock.
class ToyStream final : public Stream {
 public:
  explicit ToyStream(std::unique_ptr<Stream> inner) : inner_(std::move(inner)) {}

  [[nodiscard]] IoResult receive(std::span<std::byte> into) override;
  [[nodiscard]] IoResult send(std::span<const iovec> pieces) override;
  void shut_down() override;
  [[nodiscard]] std::size_t pending_in() const override { return plain_.size() - given_; }
  [[nodiscard]] std::size_t pending_out() const override { return rest_.size(); }
  [[nodiscard]] std::uint64_t unsent_bytes() const override;
  void limit_unsent(std::uint32_t bytes) override { inner_->limit_unsent(bytes); }
  void limit_unacknowledged(std::uint32_t ms) override { inner_->limit_unacknowledged(ms); }
  [[nodiscard]] int descriptor() const override { return inner_->descriptor(); }

 private:
  /// Reads records of about so much payload, until there is some, or nothing more comes.
  [[nodiscard]] IoStatus read_records(std::size_t payload);
  [[nodiscard]] IoStatus send_rest();

  std::unique_ptr<Stream> inner_;
  ToyCode code_;
  std::vector<std::byte> plain_;  ///< payload of whole records ...
  std::size_t given_ = 0;         ///< ... of which so much was given
  std::vector<std::byte> rest_;   ///< records that the kernel has not taken
  std::size_t records_ = 0;       ///< read since the last own one
  bool shut_down_ = false;
};

/// The same for the library, whose threads use a stream at once: under a lock of its own.
class LockedStream final : public Stream {
 public:
  explicit LockedStream(std::unique_ptr<Stream> inner) : inner_(std::move(inner)) {}

  [[nodiscard]] IoResult receive(std::span<std::byte> into) override;
  [[nodiscard]] IoResult send(std::span<const iovec> pieces) override;
  void shut_down() override;
  [[nodiscard]] std::size_t pending_in() const override;
  [[nodiscard]] std::size_t pending_out() const override;
  [[nodiscard]] std::uint64_t unsent_bytes() const override;
  void limit_unsent(std::uint32_t bytes) override;
  void limit_unacknowledged(std::uint32_t ms) override;
  [[nodiscard]] int descriptor() const override { return inner_->descriptor(); }

 private:
  mutable std::mutex mutex_;
  std::unique_ptr<Stream> inner_;
};

}  // namespace gimnet::net
