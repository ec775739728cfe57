#include "generator/flood.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <optional>
#include <string>
#include <thread>

#include "generator/wire.hpp"

namespace gimnet::perf {
namespace {

constexpr std::size_t kPayloadBytes = 1024;
constexpr std::chrono::seconds kPatience{30};

/// Two clients and, in this thread's place, the subject between them, which passes nothing on until
/// it is let.
class FloodTest : public testing::Test {
 protected:
  FloodTest() {
    engine_.connect(2);
    from_ = ::accept(listener_, nullptr, nullptr);
    to_ = ::accept(listener_, nullptr, nullptr);
    engine_.client(1).inbox.expect(0, kPayloadBytes);
    std::vector<Publisher> publishers;
    publishers.emplace_back(engine_.wire(), engine_.client(0),
                            std::vector{Target{.recipients = {&engine_.client(1)}}},
                            MessageShape{.payload_bytes = kPayloadBytes}, Writing::batched);
    flood_.emplace(engine_, std::move(publishers), 1);
  }

  ~FloodTest() override {
    if (relay_.joinable()) {
      engine_.close(engine_.client(0));
      relay_.join();
    }
    ::close(from_);
    ::close(to_);
    ::close(listener_);
  }

  /// From now on everything is passed on, until the sender closes.
  void let_through() {
    relay_ = std::thread([from = from_, to = to_] {
      std::array<char, 65536> buffer;
      for (ssize_t size; (size = ::recv(from, buffer.data(), buffer.size(), 0)) > 0;) {
        for (ssize_t sent = 0; sent < size;) {
          const ssize_t taken =
              ::send(to, buffer.data() + sent, static_cast<std::size_t>(size - sent), MSG_NOSIGNAL);
          if (taken < 0) return;
          sent += taken;
        }
      }
    });
  }

  /// Until something was given up.
  void lose_patience() {
    engine_.set_patience(std::chrono::milliseconds(10));
    const auto deadline = Clock::now() + kPatience;
    while (flood_->missing() == 0 && Clock::now() < deadline)
      flood_->run_for(std::chrono::milliseconds(20));
    engine_.set_patience(kPatience);
  }

  const std::string asked_ = "tcp://127.0.0.1:0";
  const int listener_ = listen_on(asked_);
  Wire wire_;
  Engine engine_{wire_, local_url(listener_, asked_)};
  std::optional<Flood> flood_;
  int from_ = -1;
  int to_ = -1;
  std::thread relay_;
};

TEST_F(FloodTest, CountsWhatArrives) {
  let_through();
  flood_->run_for(std::chrono::milliseconds(20));
  flood_->drain();
  EXPECT_GT(flood_->expected(), 0u);
  EXPECT_EQ(engine_.client(1).inbox.delivered(), flood_->expected());
  EXPECT_EQ(flood_->missing(), 0u);
}

TEST_F(FloodTest, GivesUpWhatDoesNotArriveInTime) {
  lose_patience();
  EXPECT_GT(flood_->missing(), 0u);
  EXPECT_EQ(engine_.client(1).inbox.settled(), 0u);
}

TEST_F(FloodTest, TakesWhatComesTooLateAsLateAndNotAsLost) {
  lose_patience();
  ASSERT_GT(flood_->missing(), 0u);
  let_through();
  const auto deadline = Clock::now() + kPatience;
  while (flood_->missing() != 0 && Clock::now() < deadline) {
    flood_->run_for(std::chrono::milliseconds(1));
    flood_->drain();
  }
  EXPECT_EQ(flood_->missing(), 0u);
  EXPECT_EQ(engine_.client(1).inbox.delivered(), flood_->expected());
  EXPECT_EQ(engine_.client(1).inbox.wrong(), 0u);
}

TEST_F(FloodTest, TellsTheLongestTimeWithoutAWriteOnce) {
  lose_patience();
  EXPECT_GT(flood_->take_longest_pause().count(), 0);
  EXPECT_EQ(flood_->take_longest_pause().count(), 0);
}

TEST_F(FloodTest, TheSubjectSeesAClientThatIsClosed) {
  engine_.close(engine_.client(1));
  char byte = 0;
  EXPECT_EQ(::recv(to_, &byte, 1, 0), 0);
  EXPECT_TRUE(engine_.client(1).is_closed);
  engine_.poll(std::chrono::nanoseconds(0));
}

}  // namespace
}  // namespace gimnet::perf
