#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "base/ids.hpp"

// The extensions between a frame's header and its payload if EXT is set (docs/protocol.md, section
// 2). All functions take them without the u16 in front that counts their bytes, as FrameView gives
// them. TRACE or AGE of a wrong size count as unknown: they are carried and not looked at. Thread
// safety: pure functions on the caller's bytes.

namespace gimnet::proto {

inline constexpr std::size_t kExtensionsPrefixSize = 2;
inline constexpr std::size_t kExtensionHeadSize = 2;

enum class ExtensionType : std::uint8_t { pad = 0, trace = 1, age = 2 };

/// Valid until: the frame's bytes change.
struct Extension {
  ExtensionType type = ExtensionType::pad;
  std::span<const std::byte> value;
};

/// Steps through extensions in order; stops at the end, and at one that does not fit (then failed()
/// is true).
class ExtensionReader {
 public:
  explicit ExtensionReader(std::span<const std::byte> extensions) : rest_(extensions) {}
  [[nodiscard]] std::optional<Extension> next();
  [[nodiscard]] bool failed() const { return failed_; }

 private:
  std::span<const std::byte> rest_;
  bool failed_ = false;
};

/// Every extension fits where it stands.
[[nodiscard]] bool valid_extensions(std::span<const std::byte> extensions);

// AGE

inline constexpr std::size_t kAgeSize = 12;

/// A frame older than `longest_ms` is not worth delivering.
struct Age {
  std::int64_t origin_ns = 0;  ///< since 1970
  std::uint32_t longest_ms = 0;
  friend constexpr bool operator==(const Age&, const Age&) = default;
};

/// The first AGE, if there is one.
[[nodiscard]] std::optional<Age> find_age(std::span<const std::byte> extensions);

/// True when more than `longest_ms` went by; an origin in the future (clocks differ) is not old.
[[nodiscard]] bool too_old(const Age& age, std::int64_t now_ns);

/// Moves the origin of the first AGE, in place, to this clock from one that is `ahead_ns` ahead of
/// it. An origin that is later than `now_ns` then becomes `now_ns`, and so does one of a clock that
/// is not known: the frame ages from now on.
void adopt_origin(std::span<std::byte> extensions, std::optional<std::int64_t> ahead_ns,
                  std::int64_t now_ns);

// TRACE

inline constexpr std::size_t kTraceHeadSize = 4;
inline constexpr std::size_t kTraceSlotSize = 24;
/// As many as the length byte of an extension can count.
inline constexpr std::size_t kTraceSlotsMax = 10;

/// When one hub had the frame; times in ns since 1970.
struct TraceSlot {
  HubId hub;
  std::int64_t arrival_ns = 0;
  std::int64_t departure_ns = 0;
  friend constexpr bool operator==(const TraceSlot&, const TraceSlot&) = default;
};

/// A TRACE as it arrived. Valid until: the frame's bytes change.
class TraceView {
 public:
  /// REQUIRES: a value of 4 + 24 n bytes.
  explicit TraceView(std::span<const std::byte> value) : value_(value) {}
  [[nodiscard]] std::size_t slots() const {
    return (value_.size() - kTraceHeadSize) / kTraceSlotSize;
  }
  /// Slots filled; never more than slots(), whatever the byte says.
  [[nodiscard]] std::size_t used() const;
  /// REQUIRES: index < slots().
  [[nodiscard]] TraceSlot slot(std::size_t index) const;
  [[nodiscard]] std::span<const std::byte> bytes() const { return value_; }

 private:
  std::span<const std::byte> value_;
};

/// The first TRACE, if there is one.
[[nodiscard]] std::optional<TraceView> find_trace(std::span<const std::byte> extensions);

/// Fills the first free slot of the first TRACE, in place. False: there is no TRACE, or it is full.
bool fill_trace(std::span<std::byte> extensions, const TraceSlot& slot);

/// Sets the departure in the last slot that was filled, if that is of `hub`. False: it is not.
bool stamp_departure(std::span<std::byte> extensions, HubId hub, std::int64_t departure_ns);

// Writing

/// Writes extensions into the caller's memory. Errors: false where there is no room; nothing is
/// written then.
class ExtensionWriter {
 public:
  explicit ExtensionWriter(std::span<std::byte> memory) : memory_(memory) {}
  /// An extension of any type. REQUIRES: value.size() <= 255.
  [[nodiscard]] bool add(ExtensionType type, std::span<const std::byte> value);
  [[nodiscard]] bool add_age(const Age& age);
  /// A TRACE with free slots for `slots` hubs, 1..kTraceSlotsMax.
  [[nodiscard]] bool add_trace(std::size_t slots);
  /// The bytes written so far: the `extensions` of FrameParts.
  [[nodiscard]] std::span<const std::byte> written() const { return memory_.first(size_); }

 private:
  std::span<std::byte> memory_;
  std::size_t size_ = 0;
};

}  // namespace gimnet::proto
