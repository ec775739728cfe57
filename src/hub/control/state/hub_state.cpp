#include "hub/control/state/hub_state.hpp"

#include <algorithm>

#include "base/check.hpp"
#include "base/endian.hpp"

namespace gimnet::hub {
namespace {

constexpr std::array<std::byte, 8> kMagic = {std::byte{'G'}, std::byte{'I'}, std::byte{'M'},
                                             std::byte{'s'}, std::byte{'t'}, std::byte{'a'},
                                             std::byte{'t'}, std::byte{'e'}};
constexpr std::uint32_t kVersion = 3;
/// Without the sets of used indices: all below the marks count as used.
constexpr std::uint32_t kVersionOfMarks = 1;
// Version 2: without what proofs of groups are judged by, as there were none.
constexpr const char* kNoHub = "it holds numbers that no hub writes";

// Layout, little-endian: magic, u32 version, u32 number of kicked tokens, secret, unique id, u64
// boot, u32 node mark, u32 group mark, u32 bytes of the set of used nodes, u32 of that of groups,
// u64 forgettings of groups, u32 bytes of the set of groups that outlasted the last one, u32 0; 24
// bytes for each kicked token (u32 index, u32 0, u64 number, i64 expiry); the three sets
// (IndexSet::bytes()); SHA-256 of all that. Before version 3 there was nothing of forgettings.
constexpr std::size_t kVersionAt = 8;
constexpr std::size_t kKickedCountAt = 12;
constexpr std::size_t kSecretAt = 16;
constexpr std::size_t kUniqueIdAt = 48;
constexpr std::size_t kBootAt = 64;
constexpr std::size_t kNodeMarkAt = 72;
constexpr std::size_t kGroupMarkAt = 76;
constexpr std::size_t kNodesUsedBytesAt = 80;
constexpr std::size_t kGroupsUsedBytesAt = 84;
constexpr std::size_t kForgettingsAt = 88;
constexpr std::size_t kOutlastingBytesAt = 96;
constexpr std::size_t kZeroAt = 100;
constexpr std::size_t kHeadSize = 104;
constexpr std::size_t kHeadSizeWithoutProofs = 88;
constexpr std::size_t kKickedSize = 24;
static_assert(kHeadSizeWithoutProofs + std::tuple_size_v<Digest> >= kHeadSize);
constexpr std::size_t kSetBytesMax = IndexSet::bytes_max(kIndexMost);
static_assert(kHubStateBytesMax ==
              kHeadSize + kKickedMax * kKickedSize + 3 * kSetBytesMax + std::tuple_size_v<Digest>);

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

bool is_index(std::uint32_t index) { return index > 0 && index <= kIndexMost; }

/// What a file from before there were sets says of what was handed out.
IndexSet all_below(std::uint32_t mark) {
  IndexSet used;
  for (std::uint32_t index = 1; index < mark; ++index) used.insert(index);
  return used;
}

/// How long the parts are that the head of a file announces; nothing: no hub writes that.
struct Lengths {
  std::size_t head = 0;
  std::size_t kicked = 0;  ///< tokens
  std::size_t nodes_used = 0;
  std::size_t groups_used = 0;
  std::size_t groups_outlasting = 0;
  [[nodiscard]] std::size_t file() const {
    return head + kicked * kKickedSize + nodes_used + groups_used + groups_outlasting +
           std::tuple_size_v<Digest>;
  }
};
/// REQUIRES: the file is as long as the longest head at least: the shortest one is.
std::optional<Lengths> lengths_of(std::span<const std::byte> file, std::uint32_t version) {
  Lengths lengths;
  lengths.head = version == kVersion ? kHeadSize : kHeadSizeWithoutProofs;
  lengths.kicked = load_le<std::uint32_t>(file.data() + kKickedCountAt);
  lengths.nodes_used = load_le<std::uint32_t>(file.data() + kNodesUsedBytesAt);
  lengths.groups_used = load_le<std::uint32_t>(file.data() + kGroupsUsedBytesAt);
  if (version == kVersion)
    lengths.groups_outlasting = load_le<std::uint32_t>(file.data() + kOutlastingBytesAt);
  const auto is_set = [](std::size_t bytes) { return bytes <= kSetBytesMax; };
  if (lengths.kicked > kKickedMax || !is_set(lengths.nodes_used) || !is_set(lengths.groups_used) ||
      !is_set(lengths.groups_outlasting)) {
    return std::nullopt;
  }
  return lengths;
}

/// The numbers of a head; false: no hub writes these.
bool read_head(std::span<const std::byte> file, std::uint32_t version, HubState& state) {
  std::copy_n(file.begin() + kSecretAt, state.secret.size(), state.secret.begin());
  std::copy_n(file.begin() + kUniqueIdAt, state.unique_id.size(), state.unique_id.begin());
  state.boot = load_le<std::uint64_t>(file.data() + kBootAt);
  state.node_mark = load_le<std::uint32_t>(file.data() + kNodeMarkAt);
  state.group_mark = load_le<std::uint32_t>(file.data() + kGroupMarkAt);
  if (version == kVersion) {
    state.group_forgettings = load_le<std::uint64_t>(file.data() + kForgettingsAt);
    if (load_le<std::uint32_t>(file.data() + kZeroAt) != 0) return false;
  }
  return state.boot <= kBootMax && is_index(state.node_mark) && is_index(state.group_mark);
}

/// The sets, which stand where `sets` begins; false: no hub writes these.
bool read_sets(std::span<const std::byte> sets, const Lengths& lengths, HubState& state) {
  const auto take = [&sets](std::size_t size, IndexSet& into) {
    std::optional<IndexSet> set = IndexSet::from_bytes(sets.first(size), kIndexMost);
    sets = sets.subspan(size);
    if (set) into = std::move(*set);
    return set.has_value();
  };
  return take(lengths.nodes_used, state.nodes_used) &&
         take(lengths.groups_used, state.groups_used) &&
         take(lengths.groups_outlasting, state.groups_outlasting) &&
         state.groups_outlasting.is_within(state.groups_used);
}

/// What newcomers of the next start may be given, and what is kept of that before.
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
  const std::span<const std::byte> groups_used = state.groups_used.bytes();
  const std::span<const std::byte> outlasting = state.groups_outlasting.bytes();
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
  store_le(bytes.data() + kGroupsUsedBytesAt, static_cast<std::uint32_t>(groups_used.size()));
  store_le(bytes.data() + kForgettingsAt, state.group_forgettings);
  store_le(bytes.data() + kOutlastingBytesAt, static_cast<std::uint32_t>(outlasting.size()));
  std::byte* at = bytes.data() + kHeadSize;
  for (const SessionToken& token : state.kicked) {
    write_kicked(at, token);
    at += kKickedSize;
  }
  bytes.insert(bytes.end(), nodes_used.begin(), nodes_used.end());
  bytes.insert(bytes.end(), groups_used.begin(), groups_used.end());
  bytes.insert(bytes.end(), outlasting.begin(), outlasting.end());
  const Digest digest = sha256(bytes);
  bytes.insert(bytes.end(), digest.begin(), digest.end());
  return bytes;
}

Result<HubState> read_hub_state(std::span<const std::byte> bytes) {
  if (bytes.size() < kHeadSizeWithoutProofs + std::tuple_size_v<Digest>)
    return Error{"it is too short"};
  if (bytes.size() > kHubStateBytesMax) return Error{"it is too long"};
  if (!std::equal(kMagic.begin(), kMagic.end(), bytes.begin()))
    return Error{"it does not hold the state of a hub"};
  const auto version = load_le<std::uint32_t>(bytes.data() + kVersionAt);
  if (version < kVersionOfMarks || version > kVersion)
    return Error{"another version of tcphub wrote it"};
  const std::optional<Lengths> lengths = lengths_of(bytes, version);
  if (!lengths || bytes.size() != lengths->file()) return Error{"its length is not what it says"};
  const std::size_t end = bytes.size() - std::tuple_size_v<Digest>;
  if (!same_bytes(sha256(bytes.first(end)), bytes.subspan(end))) return Error{"it is damaged"};
  HubState state;
  if (!read_head(bytes, version, state)) return Error{kNoHub};
  for (std::size_t i = 0; i < lengths->kicked; ++i) {
    const std::byte* at = bytes.data() + lengths->head + i * kKickedSize;
    const SessionToken token = read_kicked(at);
    if (!is_index(token.index.value()) || load_le<std::uint32_t>(at + 4) != 0) return Error{kNoHub};
    state.kicked.push_back(token);
  }
  if (!read_sets(bytes.subspan(lengths->head + lengths->kicked * kKickedSize), *lengths, state))
    return Error{kNoHub};
  if (version == kVersionOfMarks) {
    if (lengths->nodes_used + lengths->groups_used != 0) return Error{kNoHub};
    state.nodes_used = all_below(state.node_mark);
    state.groups_used = all_below(state.group_mark);
  }
  return state;
}

Result<HubStart> next_start(const HubState& found, std::chrono::milliseconds wall) {
  if (found.boot >= kBootMax)
    return Error{"the hub was started as often as can be counted (" + std::to_string(kBootMax) +
                 " times); move it away: the hub then begins anew, and nodes get new ids"};
  HubStart start;
  start.state = found;
  ++start.state.boot;
  start.nodes = begin(start.state.node_mark, start.state.nodes_used);
  start.groups = begin(start.state.group_mark, start.state.groups_used);
  start.groups.forgettings = found.group_forgettings;
  start.groups.outlasting = found.groups_outlasting;
  std::erase_if(start.state.kicked,
                [wall](const SessionToken& token) { return token.expiry <= wall; });
  return start;
}

}  // namespace gimnet::hub
