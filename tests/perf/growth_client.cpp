#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "client/gimi/inbox.hpp"
#include "client/gimi/wait_set.hpp"
#include "tests/client/gimi/support/made_message.hpp"
#include "tests/perf/growth.hpp"

namespace gimnet::hub {
namespace {

/// A node's queues, of which one is used.
struct Queues {
  explicit Queues(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) all.push_back(&inbox.add_queue({}));
  }
  gimi::Inbox inbox{64, 1 << 20, [] {}};
  std::vector<gimi::MessageQueue*> all;
  [[nodiscard]] gimi::MessageQueue& used() const { return *all[all.size() / 2]; }
  void put() {
    Message message = test::make_message("x");
    if (!inbox.put(used(), message, nullptr)) wrong("there was room");
  }
};

}  // namespace

Work queues(std::size_t count) {
  auto world = std::make_shared<Queues>(count);
  return [world, count] {
    for (std::size_t i = 0; i < count; ++i) {
      world->put();
      if (!world->inbox.receive(world->used(), kNoWait)) wrong("a message was lost");
    }
  };
}

Work wait_set(std::size_t count) {
  struct World {
    explicit World(std::size_t count) : queues(count) {
      for (gimi::MessageQueue* queue : queues.all) {
        static_cast<void>(queues.inbox.visit(*queue, [&](gimi::WaitSource& source, bool ready) {
          if (!source.join(set, {queue, 1, 1}, ready)) wrong("it was in no set");
        }));
      }
    }
    std::shared_ptr<gimi::WaitSet> set = std::make_shared<gimi::WaitSet>();
    Queues queues;
  };
  auto world = std::make_shared<World>(count);
  return [world, count] {
    std::array<gimi_ready, 8> ready{};
    for (std::size_t i = 0; i < count; ++i) {
      world->queues.put();
      if (world->set->wait(ready, kNoWait).or_throw() != 1) wrong("one was ready");
      if (!world->queues.inbox.try_receive(world->queues.used())) wrong("a message was lost");
    }
  };
}

}  // namespace gimnet::hub
