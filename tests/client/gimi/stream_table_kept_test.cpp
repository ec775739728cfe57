#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "client/gimi/stream_table.hpp"
#include "gimnet/gimi.hpp"
#include "tests/client/gimi/support/hub_process.hpp"

// The number of services that a node remembers as those it sends to.

namespace gimnet {
namespace {

using test::eventually;

constexpr Timeout kWait = std::chrono::duration_cast<Timeout>(test::kPatience);
constexpr std::size_t kKept = gimi::StreamTable::kServicesKept;

std::string service(std::size_t number) {
  // No node has so many.
  return (number < kKept / 2 ? "first/s" : "second/s") + std::to_string(number);
}

class KeptServices : public testing::Test {
 protected:
  void SetUp() override {
    for (std::size_t i = 0; i < kKept + 2; ++i) {
      const std::string name = service(i);
      const Node& node = name.starts_with("first") ? first_ : second_;
      const MessageKey key{static_cast<std::uint32_t>(i), 0};  // each has a queue of its own
      queues_.push_back(
          node.accept(name.substr(name.find('/') + 1), {.key = key}, kWait).or_throw());
    }
  }
  /// True: this node follows the service.
  [[nodiscard]] bool followed(std::size_t number) const {
    return sender_.services(service(number), kWait).or_throw().at(0).subscribers == 1;
  }
  [[nodiscard]] Sender to(std::size_t number) const {
    return sender_.sender(service(number), {}, kWait).or_throw();
  }

  test::HubProcess hub_;
  const Node first_{"first", hub_.url()};
  const Node second_{"second", hub_.url()};
  const Node sender_{"", hub_.url()};
  std::vector<Queue> queues_;
};

TEST_F(KeptServices, TheLatestWithoutASender) {
  const Sender held = to(0);
  for (std::size_t i = 1; i < kKept; ++i) to(i).send("x").or_throw();
  to(1).send("again").or_throw();
  for (const std::size_t number : {0u, 1u, 2u, 3u}) EXPECT_TRUE(followed(number)) << "at the limit";
  const Sender one_more = to(kKept);
  EXPECT_TRUE(followed(0)) << "its Sender is there";
  EXPECT_TRUE(followed(1)) << "it was asked for after the others";
  EXPECT_TRUE(eventually([&] { return !followed(2); })) << "one beyond: the oldest goes";
  EXPECT_TRUE(followed(3));
  held.send("held").or_throw();
  EXPECT_EQ(queues_[0].receive(kWait).or_throw().text(), "held");
  one_more.send("one more").or_throw();
  EXPECT_EQ(queues_[kKept].receive(kWait).or_throw().text(), "one more");
  // The stream that ended begins anew.
  to(2).send("back").or_throw();
  EXPECT_EQ(queues_[2].receive(kWait).or_throw().text(), "x");
  EXPECT_EQ(queues_[2].receive(kWait).or_throw().text(), "back");
  EXPECT_TRUE(followed(2));
  EXPECT_TRUE(eventually([&] { return !followed(3); }));
}

}  // namespace
}  // namespace gimnet
