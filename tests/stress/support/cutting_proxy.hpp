#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "tests/stress/support/size.hpp"
#include "tests/stress/support/socket.hpp"

namespace gimnet::stress {

/// The deeds of the proxy to the connection that goes through it.
struct CutPlan {
  std::size_t cuts = 0;             ///< so many, then it only forwards
  std::uint64_t bytes_between = 0;  ///< of both directions together, on average
  std::chrono::milliseconds least_life{
      0};  ///< a connection whose time has come stands still until it is so old
  std::uint32_t seed = 1;
};

/// Stands between one node and its hub: forwards bytes, and cuts the connection at random bytes,
/// now by an end of the stream, now by a reset; bytes that it holds then are lost, as in a network.
/// Thread safety: start and destruction by one thread; the counters by any. It owns one thread.
class CuttingProxy {
 public:
  CuttingProxy(std::string hub_url, const CutPlan& plan);
  CuttingProxy(const CuttingProxy&) = delete;
  CuttingProxy& operator=(const CuttingProxy&) = delete;
  ~CuttingProxy();

  [[nodiscard]] const std::string& url() const { return url_; }
  [[nodiscard]] std::size_t cuts() const { return cuts_.load(); }
  /// While held, nothing from the hub is taken, so that its kernel's buffers fill; the other
  /// direction goes on.
  void hold_downstream(bool held) { held_.store(held); }
  /// Cuts as soon as it can, outside the plan. Bytes that it holds are lost.
  void cut_now() { cut_now_.store(true); }

 private:
  struct Direction {
    std::vector<std::byte> bytes;
    std::size_t sent = 0;
  };
  void run();
  void serve();
  void choose_cut();
  [[nodiscard]] bool forward(int from, int to, Direction& direction);
  [[nodiscard]] bool write(int to, Direction& direction);
  void cut();

  const std::string hub_url_;
  const CutPlan plan_;
  Descriptor listener_;
  std::string url_;

  // the proxy's thread only
  Descriptor node_;
  Descriptor hub_;
  std::array<Direction, 2> directions_;
  std::mt19937_64 random_;
  std::uint64_t until_cut_ = 0;
  bool is_cut_due_ = false;
  Clock::time_point connected_at_;

  std::atomic<std::size_t> cuts_{0};
  std::atomic<bool> held_{false};
  std::atomic<bool> cut_now_{false};
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace gimnet::stress
