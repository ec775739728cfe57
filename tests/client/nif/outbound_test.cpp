#include "client/nif/outbound.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "proto/frame/report.hpp"
#include "tests/client/nif/support/fake_hub.hpp"
#include "tests/client/nif/support/frames.hpp"
#include "tests/client/nif/support/line.hpp"
#include "tests/client/nif/support/own_clock.hpp"

// The sending half without a hub. What a sender sees is in outbound_send_test.cpp.

namespace gimnet::nif::test {
namespace {

proto::Report report_of(proto::Kind kind, std::uint32_t count) {
  proto::Report report;
  report.reason = proto::DropReason::no_such_node;
  report.count = count;
  report.header.kind = kind;
  report.header.dst = kPeerId;
  return report;
}

TEST(Outbound, KeepsNoReportFromAProgramThatAskedForOne) {
  net::WakeSignal wake;
  Outbound outbound({}, wake);
  EXPECT_TRUE(outbound.on_report(report_of(proto::Kind::unicast, 2))) << "nobody asked";
  EXPECT_TRUE(outbound.on_report(report_of(proto::Kind::taken, 2)));
  nif_outgoing message = NIF_OUTGOING_INIT;
  message.to = kPeerId;
  message.flags = NIF_FLAG_REPORT;
  Outgoing outgoing;
  ASSERT_FALSE(outgoing.read(message));
  EXPECT_EQ(outbound.send(outgoing, 0), NIF_NOT_CONNECTED);
  EXPECT_FALSE(outbound.on_report(report_of(proto::Kind::unicast, 1)));
  EXPECT_FALSE(outbound.on_report(report_of(proto::Kind::taken, 2)))
      << "merged with one of the program's messages";
  EXPECT_TRUE(outbound.on_report(report_of(proto::Kind::taken, 1)))
      << "the library's own question alone";
}

/// Sends until the last message is left to the library's thread, which was woken: all within one
/// moment.
std::vector<std::string> send_burst(Line& line) {
  const OwnClock standing([now_ns = steady_now_ns()] { return now_ns; });
  line.attach(Line::session_of(false));
  std::vector<std::string> sent;
  while (!line.woken() && sent.size() < 100) {
    sent.push_back(std::to_string(sent.size()));
    EXPECT_EQ(line.send(sent.back()), NIF_OK);
  }
  EXPECT_EQ(payloads(line.read()), std::vector<std::string>(sent.begin(), sent.end() - 1));
  return sent;
}

TEST(Outbound, WhatWasLeftToTheLibrarysThreadIsWrittenBeforeACallback) {
  Line line;
  const std::vector<std::string> sent = send_burst(line);
  line.outbound.begin_callbacks();
  EXPECT_EQ(payloads(line.read()), std::vector<std::string>{sent.back()});
  // And nothing is left to it while it cannot write, however fast it comes.
  const OwnClock standing([now_ns = steady_now_ns()] { return now_ns; });
  for (const std::string text : {"a", "b", "c", "d", "e", "f"}) {
    EXPECT_EQ(line.send(text), NIF_OK);
    EXPECT_EQ(payloads(line.read()), std::vector<std::string>{text});
  }
  line.outbound.end_callbacks();
}

/// The library's thread gathers a burst that somebody else has written already, and ends without a
/// write of its own.
TEST(Outbound, DrainHearsOfAWriterThatHadNothingToWrite) {
  Line line;
  Outbound& outbound = line.outbound;
  static_cast<void>(send_burst(line));
  ASSERT_EQ(outbound.flush(), NIF_OK);
  nif_status drained = NIF_TIMEOUT;
  std::thread draining;
  {
    // Its first look at the clock is the first of the gathering: drain() comes then.
    const OwnClock gathering([&, now_ns = steady_now_ns()]() mutable {
      if (!draining.joinable()) {
        draining = std::thread([&] { drained = outbound.drain(kNever); });
        while (outbound.waiting() == 0) std::this_thread::yield();
      }
      return now_ns += kNsPerMs;
    });
    outbound.write_pending(false);
  }
  ASSERT_TRUE(draining.joinable()) << "nothing was gathered";
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (outbound.waiting() != 0 && std::chrono::steady_clock::now() < deadline)
    std::this_thread::yield();
  EXPECT_EQ(outbound.waiting(), 0u) << "nobody told it";
  outbound.end({NIF_CLOSED, "the test is over"});
  draining.join();
  EXPECT_EQ(drained, NIF_OK);
}

}  // namespace
}  // namespace gimnet::nif::test
