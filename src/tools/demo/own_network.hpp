#pragma once

#include <optional>
#include <string>

#include "base/result.hpp"
#include "tools/demo/child_process.hpp"
#include "tools/demo/options.hpp"

namespace gimnet::demo {

/// A new folder that only this user may enter, removed with everything in it when the object goes.
class TemporaryFolder {
 public:
  /// Makes it in TMPDIR, or in /tmp. Errors: no place for it.
  static Result<TemporaryFolder> make();

  TemporaryFolder(TemporaryFolder&& other) noexcept;
  TemporaryFolder& operator=(TemporaryFolder&& other) noexcept;
  ~TemporaryFolder();

  [[nodiscard]] const std::string& path() const { return path_; }
  /// The path of something in it.
  [[nodiscard]] std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  explicit TemporaryFolder(std::string path) : path_(std::move(path)) {}

  std::string path_;
};

/// The demo's own hub and robot, each a process, with their files in a temporary folder. Ends them,
/// the robot first, when it goes. Thread safety: one thread.
class OwnNetwork {
 public:
  /// Starts a hub on a free port and a Unix socket, then a robot that connects over the socket.
  /// `folder_of_programs` holds tcphub and gimnet-demo. Errors: a program is missing, does not
  /// start, or does not say that it is ready.
  static Result<OwnNetwork> start(const DemoOptions& options,
                                  const std::string& folder_of_programs);

  /// Where the viewer connects: the TCP address.
  [[nodiscard]] const std::string& hub_url() const { return hub_url_; }

  /// What happened to hub or robot, if one of them ended by itself; waits for the hub's end at most
  /// so long.
  [[nodiscard]] std::optional<Error> trouble(std::int64_t wait_ns = 0);

 private:
  OwnNetwork(TemporaryFolder folder, ChildProcess hub)
      : folder_(std::move(folder)), hub_(std::move(hub)) {}

  // The order is that of the end: robot, hub, folder.
  TemporaryFolder folder_;
  ChildProcess hub_;
  std::optional<ChildProcess> robot_;
  std::string hub_url_;
};

/// The addresses in the line `ready URL URL` of a hub. Errors: another line.
struct HubAddresses {
  std::string tcp;
  std::string unix_socket;
};
[[nodiscard]] Result<HubAddresses> parse_ready_line(const std::string& line);

/// The folder in which this program lies.
[[nodiscard]] std::string folder_of_this_program();

}  // namespace gimnet::demo
