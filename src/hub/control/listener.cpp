#include "hub/control/listener.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/descriptor.hpp"
#include "hub/control/port_owner.hpp"

namespace gimnet::hub {
namespace {

constexpr int kBacklog = 4'096;

Error refuse(const ListenUrl& url, const std::string& why) {
  return Error{"cannot listen on " + url.text() + ": " + why};
}

struct TcpAddress {
  sockaddr_storage storage{};
  socklen_t size = 0;
};

TcpAddress tcp_address(const ListenUrl& url) {
  TcpAddress address;
  auto* v4 = reinterpret_cast<sockaddr_in*>(&address.storage);
  if (::inet_pton(AF_INET, url.host.c_str(), &v4->sin_addr) == 1) {
    v4->sin_family = AF_INET;
    v4->sin_port = htons(url.port);
    address.size = sizeof(sockaddr_in);
    return address;
  }
  auto* v6 = reinterpret_cast<sockaddr_in6*>(&address.storage);
  if (::inet_pton(AF_INET6, url.host.c_str(), &v6->sin6_addr) == 1) {
    v6->sin6_family = AF_INET6;
    v6->sin6_port = htons(url.port);
    address.size = sizeof(sockaddr_in6);
  }
  return address;
}

/// One is the other, or every address of its family; the families never get in each other's way
/// (IPV6_V6ONLY).
bool share_a_host(const sockaddr_storage& a, const sockaddr_storage& b) {
  if (a.ss_family != b.ss_family) return false;
  if (a.ss_family == AF_INET) {
    const in_addr_t one = reinterpret_cast<const sockaddr_in&>(a).sin_addr.s_addr;
    const in_addr_t two = reinterpret_cast<const sockaddr_in&>(b).sin_addr.s_addr;
    return one == two || one == INADDR_ANY || two == INADDR_ANY;
  }
  const in6_addr& one = reinterpret_cast<const sockaddr_in6&>(a).sin6_addr;
  const in6_addr& two = reinterpret_cast<const sockaddr_in6&>(b).sin6_addr;
  const auto is = [](const in6_addr& x, const in6_addr& y) {
    return std::memcmp(&x, &y, sizeof x) == 0;
  };
  return is(one, two) || is(one, in6addr_any) || is(two, in6addr_any);
}

std::uint16_t bound_port(int descriptor) {
  sockaddr_storage storage{};
  socklen_t size = sizeof storage;
  if (::getsockname(descriptor, reinterpret_cast<sockaddr*>(&storage), &size) != 0) return 0;
  // The port stands at the same place in both families.
  return ntohs(reinterpret_cast<const sockaddr_in*>(&storage)->sin_port);
}

std::string other_reason(int error, const char* remedy) {
  const bool open_files = error == EMFILE || error == ENFILE;
  return system_text(error) + "; " +
         (open_files ? "allow more of them (ulimit -n, LimitNOFILE=)" : remedy);
}

std::string tcp_reason(const ListenUrl& url, int error) {
  if (error == EADDRINUSE) {
    const std::string owner = port_owner(url.port);
    return "the port is in use by " + (owner.empty() ? "another process" : owner) +
           "; end that, or choose another port (0: any free one)";
  }
  if (error == EACCES)
    return "ports below 1024 need rights that this user does not have; choose a higher one";
  if (error == EADDRNOTAVAIL)
    return "this machine has no such address; `ip address` shows those it has";
  if (error == EAFNOSUPPORT)
    return "this machine has no such kind of address; choose one of the other kind";
  return other_reason(error, "choose another address");
}

sockaddr_un unix_address(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path.data(), std::min(path.size(), sizeof address.sun_path - 1));
  return address;
}

/// Why the socket file has to stay: somebody answers on it, or may; "" for nobody.
std::string unix_obstacle(const sockaddr_un& address) {
  const Descriptor probe(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int failed =
      ::connect(probe.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address);
  // Also of a file that a killed process left behind, and nothing else tells it from that of a live
  // one: /proc/net/unix lacks those of other network namespaces (containers) and has others under
  // the path that was theirs.
  if (failed != 0 && errno == EACCES) {
    return "there is a socket to which this user may not connect, as that of another user; end the "
           "process that "
           "listens "
           "on it, remove it if none does, or choose another path";
  }
  if (failed != 0 && errno != EAGAIN) return {};  // EAGAIN: it listens, and its queue is full
  ucred peer{};
  socklen_t size = sizeof peer;
  const bool known =
      failed == 0 && ::getsockopt(probe.get(), SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0;
  return "the socket is in use by " + (known ? process_text(peer.pid) : "another process") +
         "; end that, or choose another path";
}

/// "" when nothing stands at the path any more, or why it has to stay.
std::string clear_path(const std::string& path, const sockaddr_un& address) {
  struct stat info{};
  if (::lstat(path.c_str(), &info) != 0) return {};
  if (S_ISDIR(info.st_mode)) {
    const std::string folder = path.substr(0, path.find_last_not_of('/') + 1);
    return "it is a folder; name a file in it, as in unix:" + folder + "/tcphub.sock";
  }
  if (!S_ISSOCK(info.st_mode))
    return "there is a file of that name that is no socket; choose another path";
  if (std::string obstacle = unix_obstacle(address); !obstacle.empty()) return obstacle;
  if (::unlink(path.c_str()) != 0) {
    return "a socket is left over there and cannot be removed: " + system_text(errno) +
           "; remove it as the user whose it is, or choose another path";
  }
  return {};
}

std::string unix_reason(const ListenUrl& url, int error) {
  const std::string above = url.path.substr(0, url.path.rfind('/'));
  const std::string folder = above.empty() ? "/" : above;
  if (error == ENOENT) {
    return "the folder " + folder + " does not exist; create it, or choose another path";
  }
  if (error == EACCES) {
    return system_text(error) + "; run tcphub as a user that may write to " + folder +
           ", or choose another path";
  }
  return other_reason(error, "choose another path");
}

}  // namespace

Result<std::unique_ptr<Listener>> Listener::open(
    const ListenUrl& url, std::span<const std::unique_ptr<Listener>> others) {
  const auto found =
      std::ranges::find_if(others, [&url](const auto& other) { return other->overlaps(url); });
  if (found != others.end()) {
    return refuse(url, "the address is given twice: this hub listens there already, as " +
                           (*found)->url().text() + "; leave one of the two out");
  }
  return url.scheme == ListenUrl::Scheme::tcp ? open_tcp(url) : open_unix(url);
}

Result<std::unique_ptr<Listener>> Listener::open_tcp(const ListenUrl& url) {
  const TcpAddress address = tcp_address(url);
  Descriptor socket(
      ::socket(address.storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (socket.get() < 0) return refuse(url, tcp_reason(url, errno));
  const int on = 1;
  // Connections of a killed process may linger on the port; with this it can be bound all the same.
  static_cast<void>(::setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on));
  if (address.storage.ss_family == AF_INET6) {
    static_cast<void>(::setsockopt(socket.get(), IPPROTO_IPV6, IPV6_V6ONLY, &on, sizeof on));
  }
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address.storage), address.size) !=
          0 ||
      ::listen(socket.get(), kBacklog) != 0) {
    return refuse(url, tcp_reason(url, errno));
  }
  ListenUrl bound = url;
  bound.port = bound_port(socket.get());
  return std::unique_ptr<Listener>(new Listener(socket.release(), bound));
}

Result<std::unique_ptr<Listener>> Listener::open_unix(const ListenUrl& url) {
  const sockaddr_un address = unix_address(url.path);
  if (const std::string why = clear_path(url.path, address); !why.empty()) return refuse(url, why);
  Descriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (socket.get() < 0) return refuse(url, unix_reason(url, errno));
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(socket.get(), kBacklog) != 0) {
    return refuse(url, unix_reason(url, errno));
  }
  std::unique_ptr<Listener> listener(new Listener(socket.release(), url));
  struct stat info{};
  if (::stat(url.path.c_str(), &info) == 0) {
    listener->device_ = info.st_dev;
    listener->file_ = info.st_ino;
  }
  return listener;
}

bool Listener::overlaps(const ListenUrl& url) const {
  if (url.scheme != url_.scheme) return false;
  if (url.scheme == ListenUrl::Scheme::tcp) {
    return url.port == url_.port &&
           share_a_host(tcp_address(url).storage, tcp_address(url_).storage);
  }
  struct stat info{};
  return ::lstat(url.path.c_str(), &info) == 0 && info.st_dev == device_ && info.st_ino == file_;
}

Listener::~Listener() {
  ::close(descriptor_);
  struct stat info{};
  const bool still_ours = url_.scheme == ListenUrl::Scheme::unix_socket &&
                          ::lstat(url_.path.c_str(), &info) == 0 && info.st_dev == device_ &&
                          info.st_ino == file_;
  if (still_ours) ::unlink(url_.path.c_str());
}

}  // namespace gimnet::hub
