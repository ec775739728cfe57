#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <string>

#include "proto/frame/fragment_header.hpp"
#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub::testing {

/// A subscriber of one group as its library would count; checks what comes.
struct CountingSubscriber {
  FakeNode* node = nullptr;
  bool resume = false;
  std::uint64_t epoch = 77;
  bool subscribed = false;
  bool known = false;  ///< its hub counts for it
  PaceTerms terms;
  std::uint8_t number = 0;                     ///< of the counts that it asked for last
  std::uint8_t counted = 0;                    ///< and of those that it has
  std::uint64_t ended = 0;                     ///< messages of the group that ended at it by these
  std::uint64_t credited = 0;                  ///< of them, told to the hub
  std::map<std::uint8_t, std::uint64_t> last;  ///< by lane: sequence of the last whole message
  std::uint64_t first_at_least = 0;  ///< of the first message of this subscription; 0: it came
  bool fresh = true;                 ///< nothing of an earlier subscription can be on its way
  /// Up to this one the last message may come again: the subscription, or what its connection
  /// counts, began anew.
  std::uint64_t repeats_up_to = 0;
  std::map<std::uint8_t, std::uint32_t> next_offset;  ///< by lane, of the message that is coming
  bool checks_repeats = true;                         ///< a message comes once, whatever happened
  bool checks_first = true;                           ///< all come in one lane

  /// The answer to its SUBSCRIBE came, with that number.
  void begin_counts(std::uint8_t answered) {
    counted = answered;
    ended = credited = 0;
  }

  /// A frame of the group came.
  void take(const GotFrame& frame) {
    if (!frame.header.has(proto::kFlagFragment)) {
      next_offset.erase(frame.header.lane);
      return take_end(frame.header.lane, std::stoull(frame.text()));
    }
    const proto::FragmentHeader fragment = proto::load_fragment_header(frame.body.data());
    const auto size = static_cast<std::uint32_t>(frame.body.size() - proto::kFragmentHeaderSize);
    auto next = next_offset.find(frame.header.lane);
    if (fragment.offset == 0) next = next_offset.insert_or_assign(frame.header.lane, 0).first;
    const bool whole = next != next_offset.end() && next->second == fragment.offset;
    if (whole) next->second += size;
    if (!whole) next_offset.erase(frame.header.lane);
    if (fragment.offset + size != fragment.total) return;
    if (whole) return take_end(frame.header.lane, fragment.message);
    count_end();
  }

  void count_end() {
    ++ended;
    // Nothing that comes before an answer is of its counts.
    if (terms.window != 0 && counted == number) {
      EXPECT_LE(ended - credited, terms.window);
    }
  }

  void take_end(std::uint8_t lane, std::uint64_t sequence) {
    count_end();
    if (!checks_repeats && sequence <= repeats_up_to) {
      EXPECT_GE(sequence, last[lane]);
    } else {
      EXPECT_GT(sequence, last[lane]) << "out of order, or twice";
    }
    last[lane] = sequence;
    if (first_at_least != 0 && checks_first) {
      EXPECT_GE(sequence, first_at_least) << "not the last message first";
      first_at_least = 0;
    }
  }
};

}  // namespace gimnet::hub::testing
