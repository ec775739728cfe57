#include "client/nif/callback_delivery.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "client/nif/record_list.hpp"

namespace gimnet::nif {
namespace {

class CallbackDeliveryTest : public testing::Test {
 protected:
  CallbackDeliveryTest() {
    options_.callback = [](void* self, const nif_incoming* in) {
      return static_cast<CallbackDeliveryTest*>(self)->take(*in);
    };
    options_.user = this;
  }

  void receive(const std::string& text) {
    Record* event = make_event(NIF_DISCONNECTED, text);
    const Item item = item_of(event, event->text.size());
    received_.push({&item, 1});
  }

  nif_verdict take(const nif_incoming& in) {
    if (room_ == 0) {
      if (room_comes_) {
        room_ = 1;
        delivery_.again();
      }
      return NIF_NOT_NOW;
    }
    --room_;
    taken_.emplace_back(in.text);
    if (taken_.back() == "last") closing_ = true;
    return NIF_DONE;
  }

  Options options_;
  net::WakeSignal wake_;
  Outbound outbound_{options_.send, wake_};
  ReceiveQueue received_{1 << 20, wake_};
  CreditBook credits_{outbound_};
  std::atomic<bool> closing_{false};
  CallbackDelivery delivery_{options_, received_, outbound_, credits_, closing_};
  int room_ = 1'000;
  bool room_comes_ = false;
  std::vector<std::string> taken_;
};

TEST_F(CallbackDeliveryTest, GivesEverythingInOrder) {
  std::vector<std::string> sent;
  for (int i = 0; i < 200; ++i) {
    sent.push_back(std::to_string(i));
    receive(sent.back());
  }
  delivery_.run();
  EXPECT_EQ(taken_, sent);
}

TEST_F(CallbackDeliveryTest, HoldsWhatHasNoRoomUntilItIsToldAgain) {
  room_ = 1;
  for (const char* text : {"a", "b", "c"}) receive(text);
  delivery_.run();
  room_ = 2;
  delivery_.run();
  EXPECT_EQ(taken_, std::vector<std::string>{"a"}) << "nobody said that there is room";
  delivery_.again();
  delivery_.run();
  EXPECT_EQ(taken_, (std::vector<std::string>{"a", "b", "c"}));
}

TEST_F(CallbackDeliveryTest, RoomThatCameWhileItAskedIsNotMissed) {
  room_ = 0;
  room_comes_ = true;
  receive("a");
  delivery_.run();
  EXPECT_EQ(taken_, std::vector<std::string>{"a"});
}

TEST_F(CallbackDeliveryTest, GivesNothingMoreWhenTheNodeCloses) {
  for (const char* text : {"a", "last", "c"}) receive(text);
  delivery_.run();
  delivery_.run();
  EXPECT_EQ(taken_, (std::vector<std::string>{"a", "last"}));
}

}  // namespace
}  // namespace gimnet::nif
