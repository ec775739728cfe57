#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/clock.hpp"
#include "base/endian.hpp"
#include "base/result.hpp"
#include "gimnet/gimi.hpp"
#include "net/wait.hpp"
#include "tools/demo/summary.hpp"

namespace gimnet::demo {

/// Asks again, 50 times a second, until it is so. False: it was not within `wait_ns`.
inline bool becomes(std::int64_t wait_ns, const std::function<bool()>& so) {
  constexpr std::int64_t kLook_ns = 20'000'000;
  const net::WakeSignal nothing;
  const std::int64_t until_ns = steady_now_ns() + wait_ns;
  while (!so()) {
    if (steady_now_ns() >= until_ns) return false;
    static_cast<void>(net::wait_for(nullptr, {}, nothing, steady_now_ns() + kLook_ns));
  }
  return true;
}

/// Pictures of a camera at one hub, for two viewers at another one. A picture begins with its
/// number and the time at which it was taken. Thread safety: open() first, then run() on one
/// thread, then tell().
class Camera {
 public:
  static constexpr std::size_t kBytes = 16 * 1024;
  static constexpr std::int64_t kPeriod_ns = 50'000'000;

  /// URLs of hubs.
  struct Places {
    std::string camera;
    std::string viewers;
  };

  /// `excuse`: of pictures whose loss is as it should be.
  explicit Camera(StreamRecord::Excuse excuse) : excuse_(std::move(excuse)) {}

  std::optional<Error> open(const Places& places);
  /// Until it is over and each viewer has what it will get. `on_look`: gets what the first viewer
  /// heard so far, after each picture.
  void run(const std::atomic<bool>& over,
           const std::function<void(const StreamRecord&, std::int64_t now_ns)>& on_look);
  void tell(LabsRecord& record) const;

 private:
  static constexpr std::int64_t kReady_ns = 15'000'000'000;
  static constexpr std::int64_t kArrive_ns = 5'000'000'000;
  static constexpr Timeout kAsk{1'000};

  struct Watching {
    Subscription pictures;
    StreamRecord seen;
  };

  /// Takes what has come.
  void look();

  StreamRecord::Excuse excuse_;
  std::vector<Node> nodes_;
  std::optional<Publisher> eye_;
  std::vector<Watching> viewers_;
  std::uint64_t sent_ = 0;
};

inline std::optional<Error> Camera::open(const Places& places) {
  for (const auto& [hub, name] :
       {std::pair(&places.camera, "camera"), {&places.viewers, ""}, {&places.viewers, ""}}) {
    NodeOptions joining;
    joining.hub = *hub;
    joining.name = name;
    Outcome<Node> node = Node::join(joining);
    if (!node) return Error{node.failure().sentence};
    nodes_.push_back(std::move(*node));
  }
  Outcome<Publisher> eye = nodes_[0].advertise("eye");
  if (!eye) return Error{eye.failure().sentence};
  eye_.emplace(std::move(*eye));
  const auto known = [this] {
    const auto found = nodes_[2].services("camera/eye", kAsk);
    return found && !found->empty();
  };
  if (!becomes(kReady_ns, known)) return Error{"camera/eye is not known at the other hub"};
  for (std::size_t viewer = 1; viewer < nodes_.size(); ++viewer) {
    Outcome<Subscription> pictures = nodes_[viewer].subscribe("camera/eye", {.queue = 1'024});
    if (!pictures) return Error{pictures.failure().sentence};
    viewers_.push_back({std::move(*pictures), {}});
  }
  if (!becomes(kReady_ns, [this] { return eye_->subscribers() > 0; }))
    return Error{"nobody was heard to subscribe to camera/eye"};
  return std::nullopt;
}

inline void Camera::run(
    const std::atomic<bool>& over,
    const std::function<void(const StreamRecord&, std::int64_t now_ns)>& on_look) {
  Bytes picture(kBytes);
  for (std::int64_t due_ns = steady_now_ns(); !over.load(); due_ns += kPeriod_ns) {
    store_le<std::uint64_t>(picture.data(), sent_ + 1);
    store_le<std::int64_t>(picture.data() + sizeof(std::uint64_t), wall_now_ns());
    if (eye_->publish(picture, kAsk)) ++sent_;
    (void)becomes(due_ns + kPeriod_ns - steady_now_ns(), [&] {
      look();
      return over.load();
    });
    on_look(viewers_.front().seen, wall_now_ns());
  }
  (void)becomes(kArrive_ns, [this] {
    look();
    return std::ranges::all_of(viewers_,
                               [this](const auto& one) { return one.seen.last_number == sent_; });
  });
}

inline void Camera::tell(LabsRecord& record) const {
  record.pictures = sent_;
  record.picture_bytes = kBytes;
  for (const auto& viewer : viewers_) record.seen.push_back(viewer.seen);
}

inline void Camera::look() {
  for (auto& viewer : viewers_) {
    while (const auto message = viewer.pictures.try_receive()) {
      if (message->data().size() != kBytes) continue;
      const std::byte* const data = message->data().data();
      const Stamp stamp{load_le<std::uint64_t>(data),
                        load_le<std::int64_t>(data + sizeof(std::uint64_t))};
      viewer.seen.take(stamp, wall_now_ns(), excuse_);
    }
  }
}

}  // namespace gimnet::demo
