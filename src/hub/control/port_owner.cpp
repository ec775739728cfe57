#include "hub/control/port_owner.hpp"

#include <filesystem>
#include <fstream>
#include <sstream>
#include <system_error>

namespace gimnet::hub {
namespace {

namespace fs = std::filesystem;

constexpr const char* kListenState = "0A";

/// The inode of the listening socket on `port` in one of the kernel's tables, or "".
std::string listening_inode(const char* table, std::uint16_t port) {
  std::ifstream file(table);
  std::string line;
  std::getline(file, line);  // the heading
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    std::string number;
    std::string local;
    std::string remote;
    std::string state;
    std::string skipped;
    std::string inode;
    fields >> number >> local >> remote >> state;
    for (int i = 0; i < 5; ++i)
      fields >> skipped;  // queues, timer, retransmissions, user, time-out
    fields >> inode;
    const std::size_t colon = local.rfind(':');
    if (state != kListenState || colon == std::string::npos) continue;
    if (std::strtoul(local.c_str() + colon + 1, nullptr, 16) == port) return inode;
  }
  return {};
}

bool holds(const fs::path& descriptors, const std::string& target) {
  std::error_code error;
  for (fs::directory_iterator entry(descriptors, error);
       !error && entry != fs::directory_iterator{}; entry.increment(error)) {
    std::error_code unreadable;
    if (fs::read_symlink(entry->path(), unreadable).string() == target) return true;
  }
  return false;
}

}  // namespace

std::string port_owner(std::uint16_t port) {
  std::string inode = listening_inode("/proc/net/tcp", port);
  if (inode.empty()) inode = listening_inode("/proc/net/tcp6", port);
  if (inode.empty()) return {};
  const std::string target = "socket:[" + inode + "]";
  std::error_code error;
  for (fs::directory_iterator entry("/proc", error); !error && entry != fs::directory_iterator{};
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    if (holds(entry->path() / "fd", target))
      return process_text(static_cast<pid_t>(std::stol(name)));
  }
  return {};
}

std::string process_text(pid_t process) {
  const std::string number = std::to_string(process);
  std::ifstream file("/proc/" + number + "/comm");
  std::string name;
  std::getline(file, name);
  return name.empty() ? "process " + number : name + " (process " + number + ")";
}

}  // namespace gimnet::hub
