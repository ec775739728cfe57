#include "tests/net/support/toy_stream.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <string_view>

#include "base/check.hpp"

namespace gimnet::net {
namespace {

constexpr std::byte kDisguise{0xA5};
constexpr std::size_t kRecordsPerOwn = 64;
/// It reads ahead, so that it keeps bytes.
constexpr std::size_t kReadLeast = 4'096;
/// Own records that a peer does not take are not heaped up.
constexpr std::size_t kRestMax = 4 * ToyCode::kRecord;

}  // namespace

std::vector<std::byte> ToyCode::encode(std::span<const std::byte> bytes) {
  std::vector<std::byte> records;
  records.reserve((bytes.size() / kPayload + 1) * kRecord);
  for (std::size_t at = 0; at < bytes.size(); at += kPayload) {
    const auto payload = bytes.subspan(at, std::min(kPayload, bytes.size() - at));
    records.push_back(std::byte(payload.size()) ^ kDisguise);
    for (std::size_t i = 0; i < kPayload; ++i) {
      records.push_back((i < payload.size() ? payload[i] : std::byte{}) ^ kDisguise);
    }
  }
  return records;
}

std::array<std::byte, ToyCode::kRecord> ToyCode::own_record() {
  std::array<std::byte, kRecord> record;
  record.fill(kDisguise);
  return record;
}

std::size_t ToyCode::decode(std::span<const std::byte> bytes, std::vector<std::byte>& plain) {
  std::size_t records = 0;
  for (const std::byte each : bytes) {
    record_[begun_++] = each ^ kDisguise;
    if (begun_ < kRecord) continue;
    begun_ = 0;
    ++records;
    const auto size = std::min(std::to_integer<std::size_t>(record_[0]), kPayload);
    plain.insert(plain.end(), record_.begin() + 1,
                 record_.begin() + 1 + static_cast<std::ptrdiff_t>(size));
  }
  return records;
}

bool toy_streams_wanted() {
  const char* const wanted = std::getenv("GIMNET_TEST_STREAM");
  return wanted != nullptr && std::string_view(wanted) == "toy";
}

IoStatus ToyStream::read_records(std::size_t payload) {
  const std::size_t records = (payload / ToyCode::kPayload + 1) * ToyCode::kRecord;
  std::vector<std::byte> memory(std::max(records, kReadLeast));
  while (pending_in() == 0) {
    plain_.clear();
    given_ = 0;
    const IoResult result = inner_->receive(memory);
    if (result.status != IoStatus::ok) return result.status;
    records_ += code_.decode(std::span(memory).first(result.bytes), plain_);
    if (records_ < kRecordsPerOwn || shut_down_ || rest_.size() > kRestMax) continue;
    records_ = 0;
    const auto own = ToyCode::own_record();
    rest_.insert(rest_.end(), own.begin(), own.end());
    static_cast<void>(send_rest());  // the next call tells of an error
  }
  return IoStatus::ok;
}

IoResult ToyStream::receive(std::span<std::byte> into) {
  GIMNET_CHECK(!into.empty());
  if (const IoStatus status = read_records(into.size()); status != IoStatus::ok) return {status, 0};
  const std::size_t size = std::min(into.size(), pending_in());
  std::memcpy(into.data(), plain_.data() + given_, size);
  given_ += size;
  return {IoStatus::ok, size};
}

IoStatus ToyStream::send_rest() {
  while (!rest_.empty()) {
    const iovec piece{rest_.data(), rest_.size()};
    const IoResult result = inner_->send({&piece, 1});
    if (result.status == IoStatus::failed) rest_.clear();
    if (result.status != IoStatus::ok) return result.status;
    rest_.erase(rest_.begin(), rest_.begin() + static_cast<std::ptrdiff_t>(result.bytes));
  }
  if (shut_down_) inner_->shut_down();
  return IoStatus::ok;
}

IoResult ToyStream::send(std::span<const iovec> pieces) {
  if (const IoStatus status = send_rest(); status != IoStatus::ok || pieces.empty())
    return {status, 0};
  if (shut_down_) return {IoStatus::failed, 0};
  std::vector<std::byte> offered;
  for (const iovec& piece : pieces) {
    const auto* bytes = static_cast<const std::byte*>(piece.iov_base);
    offered.insert(offered.end(), bytes, bytes + piece.iov_len);
  }
  std::vector<std::byte> records = ToyCode::encode(offered);
  const iovec all{records.data(), records.size()};
  const IoResult result = inner_->send({&all, 1});
  if (result.status != IoStatus::ok) return result;
  const std::size_t begun = (result.bytes + ToyCode::kRecord - 1) / ToyCode::kRecord;
  rest_.assign(records.begin() + static_cast<std::ptrdiff_t>(result.bytes),
               records.begin() + static_cast<std::ptrdiff_t>(begun * ToyCode::kRecord));
  return {IoStatus::ok, std::min(offered.size(), begun * ToyCode::kPayload)};
}

void ToyStream::shut_down() {
  shut_down_ = true;
  static_cast<void>(send_rest());
}

std::uint64_t ToyStream::unsent_bytes() const { return inner_->unsent_bytes() + rest_.size(); }

IoResult LockedStream::receive(std::span<std::byte> into) {
  const std::lock_guard lock(mutex_);
  return inner_->receive(into);
}

IoResult LockedStream::send(std::span<const iovec> pieces) {
  const std::lock_guard lock(mutex_);
  return inner_->send(pieces);
}

void LockedStream::shut_down() {
  const std::lock_guard lock(mutex_);
  inner_->shut_down();
}

std::size_t LockedStream::pending_in() const {
  const std::lock_guard lock(mutex_);
  return inner_->pending_in();
}

std::size_t LockedStream::pending_out() const {
  const std::lock_guard lock(mutex_);
  return inner_->pending_out();
}

std::uint64_t LockedStream::unsent_bytes() const {
  const std::lock_guard lock(mutex_);
  return inner_->unsent_bytes();
}

void LockedStream::limit_unsent(std::uint32_t bytes) {
  const std::lock_guard lock(mutex_);
  inner_->limit_unsent(bytes);
}

void LockedStream::limit_unacknowledged(std::uint32_t ms) {
  const std::lock_guard lock(mutex_);
  inner_->limit_unacknowledged(ms);
}

}  // namespace gimnet::net
