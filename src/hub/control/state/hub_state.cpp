#include "hub/control/state/hub_state.hpp"

#include <algorithm>

#include "base/check.hpp"
#include "base/endian.hpp"

namespace gimnet::hub {
namespace {

constexpr std::array<std::byte, 8> kMagic = {std::byte{'G'}, std::byte{'I'}, std::byte{'M'},
                                             std::byte{'s'}, std::byte{'t'}, std::byte{'a'},
                                             std::byte{'t'}, std::byte{'e'}};
constexpr std::uint32_t kVersion = 4;
constexpr const char* kNoHub = "it holds numbers that no hub writes";

// Layout, little-endian: magic, u32 version, u32 number of kicked tokens, secret, unique id, u64
// boot, u32 node mark, u32 group mark, u32 bytes of the set of used nodes, u32 drawn hub id or 0;
// 24 bytes for each kicked token (u32 index, u32 0, u64 number, i64 expiry); the set
// (IndexSet::bytes()); SHA-256 of all that.
constexpr std::size_t kVersionAt = 8;
constexpr std::size_t kKickedCountAt = 12;
constexpr std::size_t kSecretAt = 16;
constexpr std::size_t kUniqueIdAt = 48;
constexpr std::size_t kBootAt = 64;
constexpr std::size_t kNodeMarkAt = 72;
constexpr std::size_t kGroupMarkAt = 76;
constexpr std::size_t kNodesUsedBytesAt = 80;
constexpr std::size_t kDrawnHubAt = 84;
constexpr std::size_t kHeadSize = 88;
constexpr std::size_t kKickedSize = 24;
constexpr std::size_t kSetBytesMax = IndexSet::bytes_max(kIndexMost);
static_assert(kHubStateBytesMax ==
              kHeadSize + kKickedMax * kKickedSize + kSetBytesMax + std::tuple_size_v<Digest>);

void write_kicked(std::byte* to, const SessionToken& token) {
  store_le(to, token.index.value());
  store_le(to + 8, token.number);
  store_le(to + 16, static_cast<std::uint64_t>(token.expiry.count()));
}

SessionToken read_kicked(const std::byte* from) {
  SessionToken token;
  token.index = NodeIndex{load_le<std::uint32_t>(from)};
  token.number = load_le<std::uint64_t>(from + 8);
  token.expiry =
      std::chrono::milliseconds{static_cast<std::int64_t>(load_le<std::uint64_t>(from + 16))};
  return token;
}

bool may_be_drawn(std::uint32_t hub) { return hub >= kDrawnHubMin && hub <= kHubIdMax; }

bool is_index(std::uint32_t index) { return index > 0 && index <= kIndexMost; }

/// The numbers of a head; false: no hub writes these.
bool read_head(std::span<const std::byte> file, HubState& state) {
  std::copy_n(file.begin() + kSecretAt, state.secret.size(), state.secret.begin());
  std::copy_n(file.begin() + kUniqueIdAt, state.unique_id.size(), state.unique_id.begin());
  state.boot = load_le<std::uint64_t>(file.data() + kBootAt);
  state.node_mark = load_le<std::uint32_t>(file.data() + kNodeMarkAt);
  state.group_mark = load_le<std::uint32_t>(file.data() + kGroupMarkAt);
  const auto drawn = load_le<std::uint32_t>(file.data() + kDrawnHubAt);
  state.drawn_hub = HubId{static_cast<std::uint16_t>(drawn)};
  return (drawn == 0 || may_be_drawn(drawn)) && state.boot <= kBootMax &&
         is_index(state.node_mark) && is_index(state.group_mark);
}

/// The indices that newcomers of the next start may be given. Marks all earlier ones as used.
IndexRange begin(std::uint32_t& mark, IndexSet& used) {
  IndexRange range{mark, 0, used};
  IndexPool::Grant grant = IndexPool(kIndexMost, {}, range, std::chrono::milliseconds::max())
                               .next_grant(std::chrono::milliseconds{0});
  range.count = grant.count;
  mark = grant.mark;
  used = std::move(grant.used);
  return range;
}

}  // namespace

std::vector<std::byte> write_hub_state(const HubState& state) {
  GIMNET_CHECK(state.kicked.size() <= kKickedMax);
  const std::span<const std::byte> nodes_used = state.nodes_used.bytes();
  std::vector<std::byte> bytes(kHeadSize + state.kicked.size() * kKickedSize);
  std::copy(kMagic.begin(), kMagic.end(), bytes.begin());
  store_le(bytes.data() + kVersionAt, kVersion);
  store_le(bytes.data() + kKickedCountAt, static_cast<std::uint32_t>(state.kicked.size()));
  std::copy(state.secret.begin(), state.secret.end(), bytes.begin() + kSecretAt);
  std::copy(state.unique_id.begin(), state.unique_id.end(), bytes.begin() + kUniqueIdAt);
  store_le(bytes.data() + kBootAt, state.boot);
  store_le(bytes.data() + kNodeMarkAt, state.node_mark);
  store_le(bytes.data() + kGroupMarkAt, state.group_mark);
  store_le(bytes.data() + kNodesUsedBytesAt, static_cast<std::uint32_t>(nodes_used.size()));
  store_le(bytes.data() + kDrawnHubAt, std::uint32_t{state.drawn_hub.value()});
  std::byte* at = bytes.data() + kHeadSize;
  for (const SessionToken& token : state.kicked) {
    write_kicked(at, token);
    at += kKickedSize;
  }
  bytes.insert(bytes.end(), nodes_used.begin(), nodes_used.end());
  const Digest digest = sha256(bytes);
  bytes.insert(bytes.end(), digest.begin(), digest.end());
  return bytes;
}

Result<HubState> read_hub_state(std::span<const std::byte> bytes) {
  constexpr std::size_t kDigestSize = std::tuple_size_v<Digest>;
  if (bytes.size() < kHeadSize + kDigestSize) return Error{"it is too short"};
  if (bytes.size() > kHubStateBytesMax) return Error{"it is too long"};
  if (!std::equal(kMagic.begin(), kMagic.end(), bytes.begin()))
    return Error{"it does not hold the state of a hub"};
  if (load_le<std::uint32_t>(bytes.data() + kVersionAt) != kVersion)
    return Error{"another version of tcphub wrote it"};
  const std::size_t kicked = load_le<std::uint32_t>(bytes.data() + kKickedCountAt);
  const std::size_t set_size = load_le<std::uint32_t>(bytes.data() + kNodesUsedBytesAt);
  const std::size_t set_at = kHeadSize + kicked * kKickedSize;
  if (kicked > kKickedMax || set_size > kSetBytesMax ||
      bytes.size() != set_at + set_size + kDigestSize)
    return Error{"its length is not what it says"};
  const std::size_t end = bytes.size() - kDigestSize;
  if (!same_bytes(sha256(bytes.first(end)), bytes.subspan(end))) return Error{"it is damaged"};
  HubState state;
  if (!read_head(bytes, state)) return Error{kNoHub};
  for (std::size_t i = 0; i < kicked; ++i) {
    const std::byte* at = bytes.data() + kHeadSize + i * kKickedSize;
    const SessionToken token = read_kicked(at);
    if (!is_index(token.index.value()) || load_le<std::uint32_t>(at + 4) != 0) return Error{kNoHub};
    state.kicked.push_back(token);
  }
  std::optional<IndexSet> used = IndexSet::from_bytes(bytes.subspan(set_at, set_size), kIndexMost);
  if (!used) return Error{kNoHub};
  state.nodes_used = std::move(*used);
  return state;
}

HubId draw_hub(std::uint64_t random, const std::function<bool(HubId)>& taken) {
  constexpr std::uint64_t kCount = kHubIdMax - kDrawnHubMin + 1;
  for (std::uint64_t i = 0; i < kCount; ++i) {
    const HubId hub{static_cast<std::uint16_t>(kDrawnHubMin + (random % kCount + i) % kCount)};
    if (!taken(hub)) return hub;
  }
  return kOwnHub;
}

Result<HubStart> next_start(const HubState& found, std::chrono::milliseconds wall) {
  if (found.boot >= kBootMax)
    return Error{"the hub was started as often as can be counted (" + std::to_string(kBootMax) +
                 " times); move it away: the hub then begins anew, and nodes get new ids"};
  HubStart start;
  start.state = found;
  ++start.state.boot;
  start.nodes = begin(start.state.node_mark, start.state.nodes_used);
  // Nobody sends to a group of before a restart: a library declares again first.
  IndexSet no_groups;
  start.groups = begin(start.state.group_mark, no_groups);
  std::erase_if(start.state.kicked,
                [wall](const SessionToken& token) { return token.expiry <= wall; });
  return start;
}

std::uint64_t epoch_of(const HubStart& start) {
  const std::uint64_t epoch =
      load_le<std::uint64_t>(start.state.unique_id.data()) + start.state.boot;
  return epoch != 0 ? epoch : 1;
}

}  // namespace gimnet::hub
