// Memory runs out at each step of a send, one after another: the connection ends, and the next one
// finds a sending half in order. Calls that allocate only for themselves cost no connection.

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <new>
#include <optional>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "proto/frame/fragmenter.hpp"
#include "proto/frame/frame_parser.hpp"
#include "tests/client/nif/support/line.hpp"

namespace {

/// The number of allocations of this thread that still succeed; -1: all.
thread_local constinit std::int64_t t_left = -1;
thread_local constinit bool t_refused = false;

void* allocate(std::size_t size) {
  if (t_left == 0) {
    t_refused = true;
    return nullptr;
  }
  if (t_left > 0) --t_left;
  return std::malloc(size != 0 ? size : 1);
}

void* allocate_or_throw(std::size_t size) {
  void* const memory = allocate(size);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace

void* operator new(std::size_t size) { return allocate_or_throw(size); }
void* operator new[](std::size_t size) { return allocate_or_throw(size); }
void* operator new(std::size_t size, const std::nothrow_t&) noexcept { return allocate(size); }
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept { return allocate(size); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, const std::nothrow_t&) noexcept { std::free(memory); }
void operator delete[](void* memory, const std::nothrow_t&) noexcept { std::free(memory); }

namespace gimnet::nif::test {
namespace {

struct Sort {
  const char* name;
  std::size_t size;
  nif_policy policy = NIF_POLICY_DEFAULT;
  std::uint8_t flags = 0;

  friend void PrintTo(const Sort& sort, std::ostream* out) { *out << sort.name; }
};

class OutOfMemory : public testing::TestWithParam<Sort> {
 protected:
  nif_status send(const std::string& payload) {
    nif_outgoing message = NIF_OUTGOING_INIT;
    message.to = kPeerId;
    message.policy = static_cast<std::uint8_t>(GetParam().policy);
    message.flags = GetParam().flags;
    try {
      return line_->send(message, payload, 0);
    } catch (const std::bad_alloc&) {
      return NIF_NO_MEMORY;  // as the C API answers
    }
  }

  /// Does what the library's thread does then. True: the connection ended.
  bool reconnect_if_broken() {
    if (!line_->outbound.wants().no_memory) return false;
    line_->outbound.detach(true);
    frames_ = 0;
    received_.clear();
    line_->attach(Line::session_of(true));
    return true;
  }

  /// Takes what waits to the other end, in the place of the library's thread.
  void write_and_read() {
    line_->outbound.write_pending(false);
    EXPECT_FALSE(line_->outbound.wants().broken);
    const std::vector<std::byte> bytes = line_->read();
    for (std::span<const std::byte> rest = bytes; !rest.empty();) {
      const auto frame = proto::parse_frame(rest, proto::Origin::node);
      ASSERT_TRUE(frame) << "part of a frame";
      ++frames_;
      received_.append(reinterpret_cast<const char*>(frame->payload.data()), frame->payload.size());
      rest = rest.subspan(frame->header.frame_size());
    }
  }

  /// Messages before that which fails, so that it meets every place in the blocks of memory of the
  /// queues.
  void warm_up(int messages) {
    line_.emplace(Line::session_of(true));
    frames_ = 0;
    for (int i = 0; i < messages; ++i) {
      nif_outgoing message = NIF_OUTGOING_INIT;
      message.to = kPeerId;
      if (i % 2 == 0) message.lane = NIF_BULK;  // neighbours of one lane are kept as one
      ASSERT_EQ(line_->send(message, "before", 0), NIF_OK);
      write_and_read();
    }
    received_.clear();
  }

  void fail_at(std::int64_t allocation);

  std::optional<Line> line_;
  std::uint64_t frames_ = 0;
  std::string received_;  ///< since the last warm_up() or the begin of the connection
};

void OutOfMemory::fail_at(std::int64_t allocation) {
  const std::string first(GetParam().size, 'a');
  const std::string second(GetParam().size, 'b');
  t_left = allocation;
  t_refused = false;
  const nif_status status = send(first);
  t_left = -1;
  EXPECT_TRUE(status == NIF_OK || (t_refused && status == NIF_NO_MEMORY)) << status;
  const bool ended = reconnect_if_broken();
  EXPECT_EQ(ended, t_refused) << "memory ran out in the sending half";
  EXPECT_EQ(send(second), NIF_OK) << nif_error_text();
  EXPECT_EQ(line_->outbound.flush(), NIF_OK);
  write_and_read();
  const bool is_whole = GetParam().size <= proto::kUncutMessageMax;
  if (ended || !is_whole) {
    EXPECT_TRUE(received_.ends_with(second));
  } else {
    const bool replaced = GetParam().policy == NIF_LATEST;
    EXPECT_EQ(received_, replaced ? second : first + second);
  }
  EXPECT_TRUE(line_->outbound.on_confirm(frames_));
  if (ended) {
    EXPECT_EQ(line_->outbound.drain(0), NIF_NOT_CONNECTED) << "what was lost is told";
  }
  EXPECT_EQ(line_->outbound.drain(0), NIF_OK) << nif_error_text();
}

TEST_P(OutOfMemory, LeavesASendingHalfThatGoesOn) {
  constexpr int kBeforeMax = 30;  // a std::deque has blocks of 12 runs
  for (int before = 0; before <= kBeforeMax && !HasFailure(); ++before) {
    t_refused = true;
    for (std::int64_t allocation = 0; t_refused && !HasFailure(); ++allocation) {
      SCOPED_TRACE(testing::Message()
                   << before << " messages before, allocation " << allocation << " fails");
      warm_up(before);
      fail_at(allocation);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Outbound, OutOfMemory,
    testing::Values(Sort{"small", 10}, Sort{"held", 10, NIF_POLICY_DEFAULT, NIF_FLAG_MORE},
                    Sort{"latest", 10, NIF_LATEST, NIF_FLAG_KEYED | NIF_FLAG_MORE},
                    Sort{"fragments", 100'000},
                    Sort{"reported", 100'000, NIF_POLICY_DEFAULT, NIF_FLAG_REPORT}),
    [](const auto& sort) { return sort.param.name; });

}  // namespace
}  // namespace gimnet::nif::test
