#pragma once

#include <sys/types.h>

#include <memory>
#include <span>
#include <string>

#include "base/result.hpp"
#include "hub/control/listen_url.hpp"

namespace gimnet::hub {

/// A socket that listens. Thread safety: none. Ownership: of its descriptor and of its Unix
/// socket's file, which it removes unless somebody put another one there.
class Listener {
 public:
  /// Binds and listens. A port that a killed process left behind is taken over at once; so is a
  /// Unix socket's file that nobody answers on, if this user may connect to it: else there may be
  /// somebody. Errors: a sentence that names the address, what stands in the way (where it can be
  /// found out, the process, or which of this hub's `others`), and what to do.
  [[nodiscard]] static Result<std::unique_ptr<Listener>> open(
      const ListenUrl& url, std::span<const std::unique_ptr<Listener>> others = {});

  ~Listener();
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  [[nodiscard]] int descriptor() const { return descriptor_; }
  /// With the port that the system chose, if it was to choose one.
  [[nodiscard]] const ListenUrl& url() const { return url_; }
  /// Both cannot be had: `url` is this address in other words, or one of them is a part of the
  /// other.
  [[nodiscard]] bool overlaps(const ListenUrl& url) const;

 private:
  Listener(int descriptor, ListenUrl url) : descriptor_(descriptor), url_(std::move(url)) {}
  static Result<std::unique_ptr<Listener>> open_tcp(const ListenUrl& url);
  static Result<std::unique_ptr<Listener>> open_unix(const ListenUrl& url);

  const int descriptor_;
  const ListenUrl url_;
  dev_t device_ = 0;  ///< of the socket's file
  ino_t file_ = 0;    ///< its inode
};

}  // namespace gimnet::hub
