#include "hub/control/state/hub_state.hpp"

#include <algorithm>

#include "base/check.hpp"
#include "base/endian.hpp"

namespace gimnet::hub {
namespace {

constexpr std::array<std::byte, 8> kMagic = {std::byte{'G'}, std::byte{'I'}, std::byte{'M'}, std::byte{'s'},
                                             std::byte{'t'}, std::byte{'a'}, std::byte{'t'}, std::byte{'e'}};
constexpr std::uint32_t kVersion = 1;
constexpr std::uint32_t kIndexMost = kEveryIndex - 1;

// Layout, little-endian: magic, u32 version, u32 number of kicked tokens, secret, unique id, u64 boot, u32 node mark,
// u32 group mark, u64 0; 24 bytes for each kicked token (u32 index, u32 0, u64 number, i64 expiry); SHA-256 of all
// that.
constexpr std::size_t kVersionAt = 8;
constexpr std::size_t kKickedCountAt = 12;
constexpr std::size_t kSecretAt = 16;
constexpr std::size_t kUniqueIdAt = 48;
constexpr std::size_t kBootAt = 64;
constexpr std::size_t kNodeMarkAt = 72;
constexpr std::size_t kGroupMarkAt = 76;
constexpr std::size_t kUnusedAt = 80;
constexpr std::size_t kKickedAt = 88;
constexpr std::size_t kKickedSize = 24;
static_assert(kHubStateBytesMax == kKickedAt + kKickedMax * kKickedSize + std::tuple_size_v<Digest>);

void write_kicked(std::byte* to, const SessionToken& token) {
  store_le(to, token.index);
  store_le(to + 8, token.number);
  store_le(to + 16, static_cast<std::uint64_t>(token.expiry.count()));
}

SessionToken read_kicked(const std::byte* from) {
  SessionToken token;
  token.index = load_le<std::uint32_t>(from);
  token.number = load_le<std::uint64_t>(from + 8);
  token.expiry = std::chrono::milliseconds{static_cast<std::int64_t>(load_le<std::uint64_t>(from + 16))};
  return token;
}

bool is_index(std::uint32_t index) { return index > 0 && index <= kIndexMost; }

std::uint32_t next_block(std::uint32_t mark) {
  return IndexPool(kIndexMost, std::chrono::milliseconds{0}, {mark, IndexPool::kBlock}).mark(IndexPool::kBlock);
}

}  // namespace

std::vector<std::byte> write_hub_state(const HubState& state) {
  GIMNET_CHECK(state.kicked.size() <= kKickedMax);
  std::vector<std::byte> bytes(kKickedAt + state.kicked.size() * kKickedSize);
  std::copy(kMagic.begin(), kMagic.end(), bytes.begin());
  store_le(bytes.data() + kVersionAt, kVersion);
  store_le(bytes.data() + kKickedCountAt, static_cast<std::uint32_t>(state.kicked.size()));
  std::copy(state.secret.begin(), state.secret.end(), bytes.begin() + kSecretAt);
  std::copy(state.unique_id.begin(), state.unique_id.end(), bytes.begin() + kUniqueIdAt);
  store_le(bytes.data() + kBootAt, state.boot);
  store_le(bytes.data() + kNodeMarkAt, state.node_mark);
  store_le(bytes.data() + kGroupMarkAt, state.group_mark);
  std::byte* at = bytes.data() + kKickedAt;
  for (const SessionToken& token : state.kicked) {
    write_kicked(at, token);
    at += kKickedSize;
  }
  const Digest digest = sha256(bytes);
  bytes.insert(bytes.end(), digest.begin(), digest.end());
  return bytes;
}

Result<HubState> read_hub_state(std::span<const std::byte> bytes) {
  if (bytes.size() < kKickedAt + std::tuple_size_v<Digest>) return Error{"it is too short"};
  if (bytes.size() > kHubStateBytesMax) return Error{"it is too long"};
  if (!std::equal(kMagic.begin(), kMagic.end(), bytes.begin())) return Error{"it does not hold the state of a hub"};
  if (load_le<std::uint32_t>(bytes.data() + kVersionAt) != kVersion) {
    return Error{"another version of tcphub wrote it"};
  }
  const std::size_t kicked = load_le<std::uint32_t>(bytes.data() + kKickedCountAt);
  const std::size_t size = kKickedAt + std::min(kicked, kKickedMax) * kKickedSize + std::tuple_size_v<Digest>;
#ifdef GIMNET_BUG_STATE_LONGER_THAN_IT_SAYS
  if (kicked > kKickedMax || bytes.size() < size) return Error{"its length is not what it says"};
#else
  if (kicked > kKickedMax || bytes.size() != size) return Error{"its length is not what it says"};
#endif
  const std::size_t end = bytes.size() - std::tuple_size_v<Digest>;
  if (!same_bytes(sha256(bytes.first(end)), bytes.subspan(end))) return Error{"it is damaged"};
  HubState state;
  std::copy_n(bytes.begin() + kSecretAt, state.secret.size(), state.secret.begin());
  std::copy_n(bytes.begin() + kUniqueIdAt, state.unique_id.size(), state.unique_id.begin());
  state.boot = load_le<std::uint64_t>(bytes.data() + kBootAt);
  state.node_mark = load_le<std::uint32_t>(bytes.data() + kNodeMarkAt);
  state.group_mark = load_le<std::uint32_t>(bytes.data() + kGroupMarkAt);
  const std::uint64_t unused = load_le<std::uint64_t>(bytes.data() + kUnusedAt);
  if (state.boot > kBootMax || !is_index(state.node_mark) || !is_index(state.group_mark) || unused != 0) {
    return Error{"it holds numbers that no hub writes"};
  }
  for (std::size_t i = 0; i < kicked; ++i) {
    const std::byte* at = bytes.data() + kKickedAt + i * kKickedSize;
    const SessionToken token = read_kicked(at);
    if (!is_index(token.index) || load_le<std::uint32_t>(at + 4) != 0)
      return Error{"it holds numbers that no hub writes"};
    state.kicked.push_back(token);
  }
  return state;
}

Result<HubStart> next_start(const HubState& found, std::chrono::milliseconds wall) {
  if (found.boot >= kBootMax) return Error{"the hub was started as often as it can be counted"};
  HubStart start;
#ifdef GIMNET_BUG_NEWCOMERS_BEGIN_AT_ONE
  start.nodes = {1, IndexPool::kBlock};
#else
  start.nodes = {found.node_mark, IndexPool::kBlock};
#endif
  start.groups = {found.group_mark, IndexPool::kBlock};
  start.state = found;
  ++start.state.boot;
  start.state.node_mark = next_block(found.node_mark);
  start.state.group_mark = next_block(found.group_mark);
  std::erase_if(start.state.kicked, [wall](const SessionToken& token) { return token.expiry <= wall; });
  return start;
}

}  // namespace gimnet::hub
