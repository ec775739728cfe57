#include "tools/demo/own_network.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <system_error>
#include <utility>
#include <vector>

namespace gimnet::demo {
namespace {

// The path of a Unix socket has 107 bytes; the longest name in the folder takes 20 of them.
constexpr std::size_t kParentMax = 70;

}  // namespace

Result<TemporaryFolder> TemporaryFolder::make() {
  const char* given = std::getenv("TMPDIR");
  std::string parent = given != nullptr && *given != '\0' ? given : "/tmp";
  if (parent.size() > kParentMax) parent = "/tmp";
  std::string path = parent + "/gimnet-demo.XXXXXX";
  if (::mkdtemp(path.data()) == nullptr) {
    return Error{
        fmt::format("cannot make a folder in {}: {}; set TMPDIR to a place that can be written",
                    parent, std::strerror(errno))};
  }
  return TemporaryFolder(path);
}

TemporaryFolder::TemporaryFolder(TemporaryFolder&& other) noexcept
    : path_(std::exchange(other.path_, {})) {}

TemporaryFolder& TemporaryFolder::operator=(TemporaryFolder&& other) noexcept {
  std::swap(path_, other.path_);
  return *this;
}

TemporaryFolder::~TemporaryFolder() {
  if (path_.empty()) return;
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

namespace {

constexpr std::int64_t kReady_ns = 10'000'000'000;

std::vector<std::string> robot_words(const DemoOptions& options, const std::string& program,
                                     const std::string& hub_url) {
  std::vector<std::string> words = {program, "robot", "--hub", hub_url, "--robot", options.robot};
  if (!options.map.empty()) words.insert(words.end(), {"--map", options.map});
  if (!options.log.empty()) {
    words.insert(words.end(), {"--log", options.log, "--speed", fmt::format("{}", options.speed)});
  }
  return words;
}

}  // namespace

Result<HubAddresses> parse_ready_line(const std::string& line) {
  std::istringstream words(line);
  std::string word;
  HubAddresses addresses;
  if (words >> word && word == "ready") {
    while (words >> word) {
      if (word.starts_with("tcp://")) addresses.tcp = word;
      if (word.starts_with("unix:")) addresses.unix_socket = word;
    }
  }
  if (addresses.tcp.empty() || addresses.unix_socket.empty()) {
    return Error{fmt::format(
        "the hub said '{}' instead of 'ready' and its addresses; is it another version?", line)};
  }
  return addresses;
}

std::string folder_of_this_program() {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  return error ? "." : program.parent_path().string();
}

Result<OwnNetwork> OwnNetwork::start(const DemoOptions& options,
                                     const std::string& folder_of_programs) {
  Result<TemporaryFolder> folder = TemporaryFolder::make();
  if (!folder) return folder.error();
  const std::string hub_log = *folder / "tcphub.log";
  Result<ChildProcess> hub = ChildProcess::start(
      {"the hub",
       {folder_of_programs + "/tcphub", "--listen", "tcp://127.0.0.1:0", "--listen",
        "unix:" + (*folder / "hub.sock"), "--state-dir", *folder / "state"},
       hub_log});
  if (!hub) return hub.error();
  const Result<std::string> ready = hub->read_line(kReady_ns);
  if (!ready) return ready.error();
  const Result<HubAddresses> addresses = parse_ready_line(*ready);
  if (!addresses) return addresses.error();

  const std::string robot_log = *folder / "robot.log";
  OwnNetwork network(std::move(*folder), std::move(*hub));
  network.hub_url_ = addresses->tcp;
  Result<ChildProcess> robot = ChildProcess::start(
      {"the robot",
       robot_words(options, folder_of_programs + "/gimnet-demo", addresses->unix_socket),
       robot_log});
  if (!robot) return robot.error();
  network.robot_ = std::move(*robot);
  const Result<std::string> there = network.robot_->read_line(kReady_ns);
  if (!there) return there.error();
  return network;
}

std::optional<Error> OwnNetwork::trouble(std::int64_t wait_ns) {
  if (std::optional<Error> error = hub_.ended(wait_ns)) return error;
  return robot_ ? robot_->ended() : std::nullopt;
}

}  // namespace gimnet::demo
