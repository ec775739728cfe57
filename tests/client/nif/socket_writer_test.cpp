#include "client/nif/socket_writer.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "tests/client/nif/support/frames.hpp"
#include "tests/client/nif/support/own_clock.hpp"
#include "tests/client/nif/support/short_stream.hpp"

namespace gimnet::nif::test {
namespace {

using Texts = std::vector<std::string>;

/// A writer with all that it needs. Its thread is the library's and a sender's.
struct Writing final : SocketWriter::Source {
  Writing() {
    writer.attach(stream);
    connection.connect();
  }

  void refill() override {
    if (refills_fail) throw std::bad_alloc();
    if (left > 0) put(queue, NIF_NORMAL, std::to_string(left--));
  }
  [[nodiscard]] bool has_more() const override { return left > 0; }

  void send(const std::string& text, bool more = false) {
    const MutexLock lock(mutex);
    put(queue, NIF_NORMAL, text);
    writer.write_or_leave(more, mutex);
  }
  void write_pending(bool writable) {
    wake.clear();
    const MutexLock lock(mutex);
    writer.write_pending(writable, mutex);
  }
  [[nodiscard]] bool woken() const { return net::wait_for(nullptr, {}, wake, 0).woken; }
  /// All within one moment, until the library's thread is asked to write the last one.
  Texts send_burst() {
    const OwnClock standing([now_ns = steady_now_ns()] { return now_ns; });
    Texts sent;
    while (!woken() && sent.size() < 100) {
      sent.push_back("burst " + std::to_string(sent.size()));
      send(sent.back());
    }
    EXPECT_TRUE(woken());
    EXPECT_EQ(stream.taken(), Texts(sent.begin(), sent.end() - 1));
    return {sent.back()};
  }

  net::WakeSignal wake;
  Mutex mutex;
  SendQueue queue{{}};
  AppendedBytes appended;
  ConnectionState connection;
  Waiters waiters;
  ShortStream stream;
  int left = 0;  ///< messages that refill() has
  bool refills_fail = false;
  SocketWriter writer{{queue, appended, *this, connection, waiters, wake}};
};

TEST(SocketWriter, ASenderOnAnIdleConnectionWritesItsMessage) {
  Writing line;
  line.send("one");
  EXPECT_EQ(line.stream.taken(), Texts{"one"});
  EXPECT_EQ(line.writer.write_calls(), 1u);
  EXPECT_FALSE(line.woken());
  EXPECT_TRUE(line.writer.all_sent());
}

TEST(SocketWriter, AMessageWithMoreBehindItWaitsUntilThereIsEnoughOrSomebodyWrites) {
  Writing line;
  line.send("one", true);
  EXPECT_EQ(line.stream.taken(), Texts{});
  {
    const MutexLock lock(line.mutex);
    EXPECT_TRUE(line.writer.write_here(line.mutex));
    EXPECT_FALSE(line.writer.write_here(line.mutex)) << "nothing waits";
  }
  EXPECT_EQ(line.stream.taken(), Texts{"one"});
  const std::string large(70'000, 'l');
  line.send(large, true);
  EXPECT_EQ(line.stream.taken(), Texts{large});
}

TEST(SocketWriter, NothingIsWrittenToAFullKernelUntilItIsWritable) {
  Writing line;
  line.stream.room = 1;
  line.send("one");
  EXPECT_TRUE(line.writer.wants().blocked);
  line.stream.room = SIZE_MAX;
  line.send("two");
  line.write_pending(false);
  EXPECT_EQ(line.writer.write_calls(), 1u);
  line.write_pending(true);
  EXPECT_EQ(line.stream.taken(), (Texts{"one", "two"}));
  EXPECT_FALSE(line.writer.wants().blocked);
}

// Keep-alive goes by it, and the library's thread is woken for much else.
TEST(SocketWriter, OnlyBytesThatWentCountAsAWrite) {
  Writing line;
  std::int64_t now_ns = steady_now_ns();
  const OwnClock clock([&] { return now_ns; });
  line.send("one");
  const std::int64_t written_ns = now_ns;
  EXPECT_EQ(line.writer.wants().last_write_ns, written_ns);
  now_ns += 1'000'000;
  line.write_pending(false);
  EXPECT_EQ(line.writer.wants().last_write_ns, written_ns) << "nothing waited";
  line.stream.room = 0;
  line.send("two");
  EXPECT_EQ(line.writer.wants().last_write_ns, written_ns) << "the kernel took nothing";
  line.stream.room = SIZE_MAX;
  line.write_pending(true);
  EXPECT_EQ(line.writer.wants().last_write_ns, now_ns);
}

TEST(SocketWriter, ABurstIsLeftToTheLibrarysThread) {
  Writing line;
  Texts left = line.send_burst();
  line.send("and one more");
  EXPECT_EQ(line.stream.taken(), Texts{});
  line.write_pending(false);
  EXPECT_EQ(line.stream.taken(), (Texts{left[0], "and one more"}));
}

TEST(SocketWriter, TheLibrarysThreadGathersABurstUntilThereIsEnough) {
  Writing line;
  const Texts left = line.send_burst();
  int looks = 0;
  {
    // Each look at the clock finds another message.
    const OwnClock clock([&, now_ns = steady_now_ns()]() mutable {
      line.appended.add(AppendedBytes::kBurst / 4);
      ++looks;
      return now_ns += 100;
    });
    line.write_pending(false);
  }
  EXPECT_EQ(line.stream.taken(), left);
  EXPECT_LT(looks, 100);
}

TEST(SocketWriter, ACallbackLeavesNothingToTheLibrarysThread) {
  Writing line;
  const Texts left = line.send_burst();
  {
    const MutexLock lock(line.mutex);
    line.writer.begin_callbacks(line.mutex);
  }
  EXPECT_EQ(line.stream.taken(), left);
  const OwnClock standing([now_ns = steady_now_ns()] { return now_ns; });
  for (const std::string text : {"a", "b", "c", "d", "e", "f"}) {
    line.send(text);
    EXPECT_EQ(line.stream.taken(), Texts{text});
  }
  line.writer.end_callbacks();
  line.send("g");
  EXPECT_EQ(line.stream.taken(), Texts{});
}

TEST(SocketWriter, ASenderLeavesALongQueueToTheLibrarysThreadUnlessThatIsInACallback) {
  Writing line;
  line.left = 20;
  line.send("own");
  EXPECT_LT(line.stream.taken().size(), 20u);
  EXPECT_TRUE(line.woken());
  {
    const MutexLock lock(line.mutex);
    line.writer.begin_callbacks(line.mutex);
  }
  EXPECT_EQ(line.left, 0);
}

TEST(SocketWriter, AFailedWriteBreaksTheConnectionUntilTheNextIsAttached) {
  Writing line;
  line.stream.fails = true;
  line.send("one");
  EXPECT_TRUE(line.writer.wants().broken);
  EXPECT_TRUE(line.woken());
  EXPECT_FALSE(line.writer.ready());
  line.stream.fails = false;
  line.write_pending(true);
  EXPECT_EQ(line.stream.taken(), Texts{});
  line.writer.attach(line.stream);
  line.write_pending(false);
  EXPECT_EQ(line.stream.taken(), Texts{"one"});
}

TEST(SocketWriter, WithoutMemoryNothingIsWrittenUntilTheQueueBeginsAnew) {
  Writing line;
  line.refills_fail = true;
  line.send("one");
  EXPECT_TRUE(line.writer.wants().broken);
  EXPECT_TRUE(line.writer.wants().no_memory);
  EXPECT_TRUE(line.woken());
  line.refills_fail = false;
  line.writer.attach(line.stream);
  line.send("two");
  EXPECT_EQ(line.stream.taken(), Texts{});
  line.queue.drop_all();
  line.writer.begin_anew();
  line.send("three");
  EXPECT_EQ(line.stream.taken(), Texts{"three"});
}

TEST(SocketWriter, NothingIsWrittenWithoutAConnectionButTheLastWords) {
  Writing line;
  line.connection.end({NIF_CLOSED, "the handle was closed"});
  line.send("last");
  line.write_pending(true);
  EXPECT_EQ(line.stream.taken(), Texts{});
  line.stream.room = 1;
  const MutexLock lock(line.mutex);
  EXPECT_TRUE(line.writer.write_last(line.mutex)) << "more is left";
  line.stream.room = SIZE_MAX;
  EXPECT_FALSE(line.writer.write_last(line.mutex));
  EXPECT_EQ(line.stream.taken(), Texts{"last"});
  line.writer.detach(line.mutex);
  EXPECT_FALSE(line.writer.write_last(line.mutex)) << "the stream is gone";
}

TEST(SocketWriter, DetachWaitsForWhoeverWrites) {
  Writing line;
  bool written = false;  // these two under the mutex
  bool detached = false;
  std::thread detaching;
  line.stream.on_send = [&] {
    detaching = std::thread([&] {
      const MutexLock lock(line.mutex);
      line.connection.lose();
      line.writer.detach(line.mutex);
      EXPECT_TRUE(written);
      EXPECT_FALSE(line.writer.writing());
      detached = true;
    });
    for (bool waits = false; !waits; std::this_thread::yield()) {
      const MutexLock lock(line.mutex);
      waits = line.waiters.count() == 1 || detached;
      written = waits && !detached;
    }
  };
  line.send("one");
  detaching.join();
  EXPECT_EQ(line.stream.taken(), Texts{"one"});
}

}  // namespace
}  // namespace gimnet::nif::test
