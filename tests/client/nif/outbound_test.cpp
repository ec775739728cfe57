#include "client/nif/outbound.hpp"

#include <gtest/gtest.h>

#include "proto/frame/report.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

// The sending half without a connection. What a sender sees is in outbound_send_test.cpp.

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
  WakeSignal wake;
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
  EXPECT_FALSE(outbound.on_report(report_of(proto::Kind::taken, 2))) << "merged with one of the program's messages";
  EXPECT_TRUE(outbound.on_report(report_of(proto::Kind::taken, 1))) << "the library's own question alone";
}

}  // namespace
}  // namespace gimnet::nif::test
