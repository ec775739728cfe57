#include "client/gimi/received_streams.hpp"

#include <gtest/gtest.h>

namespace gimnet::gimi {
namespace {

using Step = StreamEpochs::Step;

TEST(StreamEpochs, LookingChangesNothing) {
  StreamEpochs epochs;
  EXPECT_EQ(epochs.look(0), Step::first);
  EXPECT_EQ(epochs.look(0), Step::first);
  epochs.take(0);
  EXPECT_EQ(epochs.look(0), Step::goes_on);
  EXPECT_EQ(epochs.look(7), Step::begins);
  EXPECT_EQ(epochs.look(0), Step::goes_on);
}

TEST(StreamEpochs, RememberTheLastEightThatWereReplaced) {
  StreamEpochs epochs;
  for (std::uint32_t epoch = 1; epoch <= 10; ++epoch) epochs.take(epoch);
  EXPECT_EQ(epochs.look(10), Step::goes_on);
  for (std::uint32_t epoch = 2; epoch <= 9; ++epoch) EXPECT_EQ(epochs.look(epoch), Step::former);
  EXPECT_EQ(epochs.look(1), Step::begins) << "it is the ninth";
}

TEST(StreamEpochs, AMessageOfTheCurrentOneReplacesNothing) {
  StreamEpochs epochs;
  epochs.take(1);
  epochs.take(2);
  for (int i = 0; i < 20; ++i) epochs.take(2);
  EXPECT_EQ(epochs.look(1), Step::former);
}

TEST(ReceivedStreams, AreApartByAllThatNamesThem) {
  ReceivedStreams streams;
  const ReceivedStreamName name{Peer{1}, 0, 0, {2, 3}};
  streams.find(name).take(1);
  EXPECT_EQ(streams.find(name).look(2), Step::begins);
  EXPECT_EQ(streams.find({Peer{2}, 0, 0, {2, 3}}).look(2), Step::first);
  EXPECT_EQ(streams.find({Peer{1}, 4, 0, {2, 3}}).look(2), Step::first);
  EXPECT_EQ(streams.find({Peer{1}, 0, 5, {2, 3}}).look(2), Step::first);
  EXPECT_EQ(streams.find({Peer{1}, 0, 0, {2, 4}}).look(2), Step::first);
}

TEST(ReceivedStreams, ASenderOfTooManyLosesItsOwn) {
  ReceivedStreams streams;
  const ReceivedStreamName before{Peer{1}, 0, 0, {}};
  const ReceivedStreamName behind{Peer{9}, 0, 0, {}};
  streams.find(before).take(1);
  streams.find(behind).take(1);
  for (std::uint32_t key = 0; key < ReceivedStreams::kStreamsMax + 2; ++key)
    streams.find({Peer{5}, 0, 0, {key, 0}}).take(1);
  EXPECT_EQ(streams.size(), ReceivedStreams::kStreamsMax);
  EXPECT_EQ(streams.find(before).look(1), Step::goes_on);
  EXPECT_EQ(streams.find(behind).look(1), Step::goes_on);
}

}  // namespace
}  // namespace gimnet::gimi
