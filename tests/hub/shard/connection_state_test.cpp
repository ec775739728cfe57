#include "hub/shard/connection.hpp"

#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

constexpr unsigned kHeld = ReadGate::held;
constexpr unsigned kNoRoom = ReadGate::no_room;
constexpr unsigned kDraining = ReadGate::draining;
constexpr unsigned kRest = ReadGate::rest;

struct Reading {
  unsigned reasons;
  bool reads;
  bool reads_for_confirm;
};
constexpr Reading kReadings[] = {
    {0, true, true},
    {kHeld, false, true},
    {kNoRoom, false, false},
    {kDraining, false, true},
    {kRest, true, true},
    {kHeld | kNoRoom, false, false},
    {kHeld | kDraining, false, true},
    {kHeld | kRest, false, true},
    {kNoRoom | kDraining, false, false},
    {kNoRoom | kRest, false, false},
    {kDraining | kRest, false, true},
    {kHeld | kNoRoom | kDraining, false, false},
    {kHeld | kNoRoom | kRest, false, false},
    {kHeld | kDraining | kRest, false, true},
    {kNoRoom | kDraining | kRest, false, false},
    {kHeld | kNoRoom | kDraining | kRest, false, false},
};

struct Writing {
  WriteState state;
  bool writes;
  bool writes_pending;  ///< where the stream has bytes of its own to write
  bool may_read;
};
constexpr Writing kWritings[] = {
    {WriteState::open, false, true, true},
    {WriteState::blocked, true, true, true},
    {WriteState::failed, false, false, true},
    {WriteState::gone, false, false, false},
};

TEST(ConnectionState, SaysWhatIsWaitedFor) {
  for (const Reading& reading : kReadings) {
    ReadGate gate;
    for (const auto reason :
         {ReadGate::held, ReadGate::no_room, ReadGate::draining, ReadGate::rest}) {
      if ((reading.reasons & reason) != 0) gate.shut(reason);
    }
    EXPECT_EQ(gate.is_open(), reading.reasons == 0);
    for (const Writing& writing : kWritings) {
      for (const bool must_confirm : {false, true}) {
        const bool reads = must_confirm ? reading.reads_for_confirm : reading.reads;
        for (const std::size_t pending_out : {0u, 1u}) {
          const Interest expected{
              .read = reads && writing.may_read,
              .write = pending_out == 0 ? writing.writes : writing.writes_pending};
          EXPECT_EQ(interest_of(gate, writing.state, must_confirm, pending_out), expected)
              << reading.reasons << ", " << static_cast<int>(writing.state) << ", " << must_confirm;
        }
      }
    }
  }
}

TEST(ReadGate, OpensWhenTheLastReasonGoes) {
  ReadGate gate;
  gate.shut(ReadGate::held);
  gate.shut(ReadGate::rest);
  gate.shut(ReadGate::held);
  gate.clear(ReadGate::held);
  EXPECT_FALSE(gate.is_open());
  EXPECT_FALSE(gate.has(kHeld | kNoRoom));
  EXPECT_TRUE(gate.has(kHeld | kRest));
  gate.clear(ReadGate::rest);
  EXPECT_TRUE(gate.is_open());
}

}  // namespace
}  // namespace gimnet::hub
