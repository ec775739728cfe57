#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/ids.hpp"
#include "proto/control/control_message.hpp"
#include "proto/control/hub_identity.hpp"
#include "proto/frame/frame_header.hpp"

// The beginning and end of a connection: the opening bytes, HELLO, WELCOME and GOODBYE
// (docs/protocol.md, section 3). Encode and decode with encode() and decode<>() of
// control_message.hpp. Thread safety: value types and pure functions.

namespace gimnet::proto {

// The opening

inline constexpr std::size_t kOpeningSize = 8;
inline constexpr std::uint8_t kVersionMajor = 1;
inline constexpr std::uint8_t kVersionMinor = 0;
/// The first bytes of both directions: "GIMnet", major and minor version.
inline constexpr std::array<std::byte, kOpeningSize> kOpening = {
    std::byte{'G'}, std::byte{'I'}, std::byte{'M'},           std::byte{'n'},
    std::byte{'e'}, std::byte{'t'}, std::byte{kVersionMajor}, std::byte{kVersionMinor}};
/// Opening and HELLO together.
inline constexpr std::size_t kAdmissionBytesMax = 1024;

enum class Opening : std::uint8_t {
  accepted,
  need_more,       ///< right so far
  other_protocol,  ///< does not begin with "GIMnet"
  bad_version,     ///< another major version
};
[[nodiscard]] Opening check_opening(std::span<const std::byte> bytes);

// A hub's words of itself, in HELLO and WELCOME of a link (docs/protocol.md, section 10)

inline constexpr std::size_t kLinkNameBytesMax = 255;
inline constexpr std::size_t kIntroducedVersionBytesMax = 64;

struct HubIntroduction {
  HubKey hub;
  HubInstance instance;
  bool configured = false;  ///< its hub id was configured, and not drawn
  std::string hub_name;
  std::string version;     ///< of its program, for people
  std::string link_name;   ///< HELLO: what the dialler calls the link; 1..255 bytes
  std::uint16_t cost = 0;  ///< HELLO: 1..65,535; 0: measured by the dialler
  std::uint32_t keep_alive_ms = 0;
  std::uint32_t silent_ms = 0;
  std::uint64_t features_required = 0;
  /// The number under which its counts of the link go on, or in WELCOME begin; 0: none.
  std::uint64_t counts = 0;
  friend bool operator==(const HubIntroduction&, const HubIntroduction&) = default;
};

// HELLO

enum class LinkOperation : std::uint16_t { hello = 1, welcome = 2, goodbye = 3 };

enum class Role : std::uint8_t { node = 0, hub = 1, admin = 2 };

inline constexpr std::uint32_t kResumeBufferDefault = 1024 * 1024;

struct Hello {
  static constexpr std::uint16_t kOperation = static_cast<std::uint16_t>(LinkOperation::hello);
  static constexpr const char* kName = "HELLO";

  Role role = Role::node;        ///< as sent: may be a value that is not listed
  std::string name;              ///< empty: none wanted. As sent: check with node_name_fault()
  std::vector<std::byte> token;  ///< empty: a new session
  std::uint64_t epoch = 0;       ///< random, new for each life of this end's counts
  bool resume = false;           ///< wanted
  std::uint32_t frame_length_max = kFrameLengthDefault;
  std::uint64_t features = 0;
  std::string description;             ///< for people, at most 256 bytes
  std::uint64_t resume_epoch = 0;      ///< the hub's, from the earlier WELCOME; 0: none
  std::uint64_t resume_taken = 0;      ///< data frames of that epoch taken from the hub
  std::optional<std::uint16_t> shard;  ///< wished for
  std::uint32_t resume_buffer_bytes = kResumeBufferDefault;
  NodeId former;                                ///< the id that goes with the token; 0: none
  std::optional<HubIntroduction> introduction;  ///< role hub

  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Hello read(Fields& fields);
  friend bool operator==(const Hello&, const Hello&) = default;
};

// WELCOME

/// Features that a hub offers in WELCOME.
inline constexpr std::uint64_t kFeatureMissed = 1;  ///< takes FLOW MISSED

struct Welcome {
  static constexpr std::uint16_t kOperation = static_cast<std::uint16_t>(LinkOperation::welcome);
  static constexpr const char* kName = "WELCOME";

  NodeId node;
  std::vector<std::byte> token;  ///< 1..128 bytes; a hub gets none
  HubId hub;
  std::string hub_name;
  std::uint64_t epoch = 0;  ///< the hub's, for this session
  std::uint32_t frame_length_max = kFrameLengthDefault;
  std::uint64_t features = 0;
  std::uint32_t keep_alive_ms = 0;
  std::uint32_t silent_ms = 0;
  std::int64_t hub_time_ns = 0;  ///< since 1970
  bool resumed = false;          ///< both epochs matched: counts go on
  std::uint64_t taken = 0;       ///< data frames of this epoch that the hub took from this node
  std::uint32_t resume_buffer_bytes = 0;  ///< 0: no resume on this connection
  std::uint32_t grace_ms = 0;
  std::uint16_t last_goodbye_code =
      0;  ///< with which the hub closed the session's last connection; 0: it did not
  std::string last_goodbye_sentence;
  std::string name;  ///< as registered
  /// Application data of the largest message of a retained service that the hub keeps; nothing: it
  /// does not tell.
  std::optional<std::uint32_t> retained_bytes_max;
  std::optional<HubIntroduction> introduction;  ///< to a hub

  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Welcome read(Fields& fields);
  friend bool operator==(const Welcome&, const Welcome&) = default;
};

// GOODBYE

enum class GoodbyeCode : std::uint16_t {
  done = 0,
  bad_version = 1,
  malformed = 2,
  hello_timeout = 3,
  name_taken = 4,
  bad_name = 5,
  hub_full = 6,
  draining = 7,
  replaced = 8,
  silent = 9,
  slow_consumer = 10,
  wrong_source = 11,
  not_allowed = 12,
  too_many_requests = 13,
  stalled_frame = 14,
  kicked = 15,
  no_memory = 16,
  renumbered = 17,
  oddities = 18,
  id_taken = 19,
  copied = 20,
};
/// The number of codes, which are counted from 0 without a gap.
inline constexpr std::size_t kGoodbyeCount = 21;
/// The code as documents and tools print it, for example "name_taken".
[[nodiscard]] const char* goodbye_name(GoodbyeCode code);

struct Goodbye {
  static constexpr std::uint16_t kOperation = static_cast<std::uint16_t>(LinkOperation::goodbye);
  static constexpr const char* kName = "GOODBYE";

  GoodbyeCode code = GoodbyeCode::done;  ///< as sent: may be a value that is not listed
  std::string sentence;                  ///< what happened and what to mend

  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Goodbye read(Fields& fields);
  friend bool operator==(const Goodbye&, const Goodbye&) = default;
};

}  // namespace gimnet::proto
