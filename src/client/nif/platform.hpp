#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "base/result.hpp"
#include "client/nif/error.hpp"

// Everything that NIF asks of the operating system, sockets first. platform_linux.cpp implements
// it; another system needs another such file and nothing else.

namespace gimnet::nif {

struct Endpoint;

/// A descriptor of the system, -1: none.
using Descriptor = int;

struct IoResult {
  enum class State : std::uint8_t { done, would_block, ended, failed };
  State state = State::failed;
  std::size_t bytes = 0;
  int error = 0;  ///< of the system, where failed
};

struct SocketOptions {
  std::uint32_t receive_bytes = 0;  ///< SO_RCVBUF; 0: the system's
  std::uint32_t send_bytes = 0;     ///< SO_SNDBUF; 0: the system's
};

/// Wakes a thread that waits in wait_for(). Thread safety: any thread.
class WakeSignal {
 public:
  WakeSignal();  ///< valid() tells whether the system had a descriptor left
  ~WakeSignal();
  WakeSignal(const WakeSignal&) = delete;
  WakeSignal& operator=(const WakeSignal&) = delete;
  [[nodiscard]] bool valid() const { return descriptor_ >= 0; }
  [[nodiscard]] Descriptor descriptor() const { return descriptor_; }
  void raise();
  void clear();

 private:
  const Descriptor descriptor_;
};

/// A connected stream socket that never blocks. Move-only; closes at destruction.
/// Thread safety: read, write and shutdown at once from different threads; moving and closing by
/// one owner alone.
class Socket {
 public:
  Socket() = default;
  explicit Socket(Descriptor descriptor) : descriptor_(descriptor) {}
  Socket(Socket&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  Socket& operator=(Socket&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }
  ~Socket() { close(); }

  [[nodiscard]] bool open() const { return descriptor_ >= 0; }
  [[nodiscard]] Descriptor descriptor() const { return descriptor_; }
  /// At most 64 pieces in one system call, without SIGPIPE.
  [[nodiscard]] IoResult write(std::span<const std::span<const std::byte>> pieces);
  [[nodiscard]] IoResult read(std::span<std::byte> memory);
  void shutdown_write();
  void close();

 private:
  Descriptor descriptor_ = -1;
};

inline constexpr std::size_t kWritePiecesMax = 64;

/// Connects, trying each address of the host. Gives up at the deadline or when `cancel` is raised.
/// Errors: NIF_NO_HUB, NIF_NO_HOST, NIF_TIMEOUT, NIF_CLOSED (cancelled), NIF_NO_MEMORY, NIF_SYSTEM.
[[nodiscard]] Result<Socket, Failure> dial(const Endpoint& endpoint, const SocketOptions& options,
                                           Deadline deadline, const WakeSignal& cancel);

struct Ready {
  bool readable = false;  ///< or ended, or failed: read() tells
  bool writable = false;
  bool woken = false;
};

/// Waits until the socket is ready for what is asked, the signal is raised, or the deadline. The
/// socket may be closed (then only the signal counts).
[[nodiscard]] Ready wait_for(const Socket& socket, bool read, bool write, const WakeSignal& wake,
                             Deadline deadline);

struct Raised {
  bool one = false;
  bool other = false;
};
/// Waits until one of them is raised, or the deadline; maybe less.
[[nodiscard]] Raised wait_for_either(const WakeSignal& one, const WakeSignal& other,
                                     Deadline deadline);

/// "" where it is not set.
[[nodiscard]] std::string environment(const char* name);
/// Where this user's hub has its socket: runtime_folder_of_user(). One in the temporary folder,
/// where anybody can make folders, counts only if it is there, belongs to this user and is closed
/// to others; else "".
[[nodiscard]] std::string runtime_folder();
[[nodiscard]] std::size_t unix_path_max();

/// Threads started while it lives take no signals: those belong to the program.
class SignalsBlocked {
 public:
  SignalsBlocked();
  ~SignalsBlocked();
  SignalsBlocked(const SignalsBlocked&) = delete;
  SignalsBlocked& operator=(const SignalsBlocked&) = delete;

 private:
  struct Saved;
  std::unique_ptr<Saved> saved_;
};

/// Changes in a child after fork(); never in the process that called it.
[[nodiscard]] std::uint32_t fork_generation();
[[nodiscard]] std::string system_error_text(int error);

}  // namespace gimnet::nif
