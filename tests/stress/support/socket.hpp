#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

// Sockets and descriptors of the stress tests. Failures throw std::runtime_error, which fails the
// test.

namespace gimnet::stress {

/// Owns a descriptor.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~Descriptor() { reset(); }
  [[nodiscard]] int get() const { return number_; }
  [[nodiscard]] bool is_open() const { return number_ >= 0; }
  void reset();

 private:
  int number_;
};

/// Sizes of the kernel's buffers; 0: the system's.
struct SocketOptions {
  int receive_buffer_bytes = 0;
  int send_buffer_bytes = 0;
};

/// A connected, non-blocking socket. `url` as the hub prints it.
[[nodiscard]] Descriptor dial(const std::string& url, const SocketOptions& options = {});
/// A non-blocking listener on a free port of loopback, and its URL.
[[nodiscard]] std::pair<Descriptor, std::string> listen_on_loopback();

/// Waits until one of the descriptors is readable, or the time is over.
void wait_readable(const std::vector<int>& descriptors, int timeout_ms);
/// Resets a TCP connection when it is closed, instead of ending it.
void reset_on_close(int socket);
/// Lets this process hold as many descriptors as its hard limit allows, and returns that number.
std::size_t raise_descriptor_limit();

}  // namespace gimnet::stress
