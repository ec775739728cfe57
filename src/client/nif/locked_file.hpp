#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>

#include "client/nif/platform.hpp"

// Small files that outlive a program, in a folder that is closed to other users.

namespace gimnet::nif {

/// The folder `tokens` in runtime_folder_of_user(): both made if need be, and refused unless they
/// are folders of mode 0700 of this user, not reached over a link. Thread safety: none. Ownership:
/// of a descriptor.
class PrivateFolder {
 public:
  /// fault() tells whether it can be used.
  PrivateFolder();
  ~PrivateFolder();
  PrivateFolder(const PrivateFolder&) = delete;
  PrivateFolder& operator=(const PrivateFolder&) = delete;

  /// "" or why it cannot be used, and what to do.
  [[nodiscard]] const std::string& fault() const { return fault_; }
  /// With its name in it, as long as fault() is "".
  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] Descriptor descriptor() const { return descriptor_; }

 private:
  void enter(Descriptor above, const std::string& name, const std::string& path);

  std::string fault_;
  std::string path_;
  Descriptor descriptor_ = -1;
};

/// A file of mode 0600 that one LockedFile in the whole system has open at a time: locked while it
/// lives, in whichever way its process ends. A child after fork() does not keep it locked. Thread
/// safety: none. Ownership: of a descriptor; move-only.
class LockedFile {
 public:
  enum class State : std::uint8_t {
    open,
    missing,  ///< there is none, and none was to be made
    in_use,   ///< somebody else has it open
    refused,  ///< it is not a file of this user alone, or the system would not
  };

  LockedFile() = default;
  LockedFile(LockedFile&& other) noexcept;
  LockedFile& operator=(LockedFile&& other) noexcept;
  ~LockedFile() { close(); }

  /// Opens and locks `name` in the folder, `made` first if it is not there. REQUIRES: is_open() is
  /// false; `name` has no
  /// '/' in it.
  [[nodiscard]] State open(const PrivateFolder& folder, const std::string& name, bool made);
  [[nodiscard]] bool is_open() const { return descriptor_ >= 0; }

  /// The file's beginning, as much as fits. Returns how much that is.
  [[nodiscard]] std::size_t read(std::span<std::byte> memory) const;
  /// Makes this the file's content, in one piece. False: the system would not.
  [[nodiscard]] bool write(std::span<const std::byte> content);
  /// Removes the file from its folder and closes it. REQUIRES: it was opened there.
  void remove(const PrivateFolder& folder, const std::string& name);
  /// Unlocks it; the file stays.
  void close();

 private:
  Descriptor descriptor_ = -1;
};

}  // namespace gimnet::nif
