#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "gimnet/gimi.hpp"
#include "impair/fault_proxy.hpp"
#include "net/address.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/size.hpp"
#include "tests/stress/support/socket.hpp"

// A camera gives 30 pictures a second, and a program needs half a second for each. With
// `newest_only` each picture that it takes is fresh. The age is that at which the program takes it,
// by one clock. A test that runs beside others allows ten times the age.

namespace gimnet::stress {
namespace {

constexpr std::size_t kPictureBytes = 200'000;
constexpr std::chrono::microseconds kPeriod(1'000'000 / 30);
constexpr int kWorkMs = 500;  ///< with each picture
constexpr std::uint64_t kLinkBytesPerS = 1'000'000;
constexpr double kTransmissionMs = 1000.0 * kPictureBytes / kLinkBytesPerS;
constexpr double kLinkDelayMs = 20.0;

std::size_t runs() { return is_full_size() ? 5 : 1; }
std::size_t pictures() { return is_full_size() ? 20 : 4; }
double allowed(double age_ms) { return is_full_size() ? age_ms : 10 * age_ms; }

/// Films until it is destroyed.
class Camera {
 public:
  explicit Camera(const std::string& hub)
      : node_("robot", hub), publisher_(node_.advertise("camera").or_throw()) {
    thread_ = std::thread([this] { film(); });
  }
  Camera(const Camera&) = delete;
  Camera& operator=(const Camera&) = delete;
  ~Camera() {
    over_ = true;
    thread_.join();
  }

 private:
  void film() {
    std::string picture(kPictureBytes, 'p');
    for (auto due = Clock::now(); !over_; due += kPeriod) {
      while (Clock::now() < due) wait_readable({}, 1);
      const std::int64_t taken = Clock::now().time_since_epoch().count();
      std::memcpy(picture.data(), &taken, sizeof taken);
      publisher_.publish(picture);
    }
  }

  const Node node_;
  const Publisher publisher_;
  std::atomic<bool> over_{false};
  std::thread thread_;
};

double median(std::vector<double> numbers) {
  std::ranges::sort(numbers);
  return numbers[numbers.size() / 2];
}

/// Ages in ms: the median, and the highest.
struct Ages {
  double middle = 0;
  double highest = 0;
};

/// Works with pictures. The first ones come while the connection is new.
Ages look(const Subscription& camera) {
  std::vector<double> ages;
  for (std::size_t i = 0; i < pictures() + 2; ++i) {
    const Message picture = camera.receive(Timeout{30'000}).or_throw();
    std::int64_t taken = 0;
    std::memcpy(&taken, picture.data().data(), sizeof taken);
    const Clock::time_point then{Clock::duration(taken)};
    if (i >= 2)
      ages.push_back(std::chrono::duration<double, std::milli>(Clock::now() - then).count());
    wait_readable({}, kWorkMs);
  }
  return {median(ages), *std::ranges::max_element(ages)};
}

/// The medians of several runs.
Ages look_again(const Subscription& camera) {
  std::vector<double> middles;
  std::vector<double> highest;
  for (std::size_t i = 0; i < runs(); ++i) {
    const Ages ages = look(camera);
    middles.push_back(ages.middle);
    highest.push_back(ages.highest);
  }
  const Ages all{median(middles), median(highest)};
  testing::Test::RecordProperty("median_ms", std::to_string(all.middle));
  testing::Test::RecordProperty("highest_ms", std::to_string(all.highest));
  return all;
}

TEST(Camera, IsFreshOverAUnixSocket) {
  const HubProcess hub;
  const Camera camera(hub.unix_url());
  const Node viewer("viewer", hub.unix_url());
  const auto pictures = viewer.subscribe("robot/camera", {.newest_only = true}).or_throw();
  const Ages ages = look_again(pictures);
  EXPECT_LT(ages.middle, allowed(40));
  EXPECT_LT(ages.highest, allowed(100));
}

/// A connection of kLinkBytesPerS to that hub.
std::unique_ptr<impair::FaultProxy> slow_way_to(const HubProcess& hub) {
  impair::Impairment how;
  how.rate = kLinkBytesPerS;
  how.queue = 32 * 1024;
  how.delay_ns = static_cast<std::int64_t>(kLinkDelayMs * 1e6);
  auto opened = impair::FaultProxy::open(*net::parse_address("tcp://127.0.0.1:0", 0),
                                         *net::parse_address(hub.tcp_url()), how, 1);
  if (!opened) throw std::runtime_error("cannot open a fault proxy");
  return std::move(*opened);
}

TEST(Camera, IsFreshBehindASlowConnection) {
  const HubProcess hub;
  const auto way = slow_way_to(hub);
  const Camera camera(hub.unix_url());
  const Node viewer("viewer", way->url());
  const auto pictures = viewer.subscribe("robot/camera", {.newest_only = true}).or_throw();
  const Ages ages = look_again(pictures);
  EXPECT_LT(ages.highest, allowed(3 * kTransmissionMs + kLinkDelayMs));
}

TEST(Camera, IsFreshBehindASlowLink) {
  const HubProcess near({"--hub-id", "1", "--accept-links"});
  const auto way = slow_way_to(near);
  const HubProcess far({"--hub-id", "2", "--link", way->url()});
  const Camera camera(near.unix_url());
  const Node viewer("viewer", far.unix_url());
  const auto pictures = viewer.subscribe("robot/camera", {.newest_only = true}).or_throw();
  const Ages ages = look_again(pictures);
  EXPECT_LT(ages.highest, allowed(3 * kTransmissionMs + kLinkDelayMs));
}

}  // namespace
}  // namespace gimnet::stress
