#include "proto/control/ns_register.hpp"

#include <gtest/gtest.h>

#include "tests/proto/control/support/ns_vectors.hpp"

namespace gimnet::proto::ns {
namespace {

std::vector<std::byte> token() { return test::from_hex("01 02 03 04 05 06 07 08"); }

TEST(NsRegisterMessages, AreDecodedAndWrittenAsTheVectorsSay) {
  test::expect_request("ns/register", 9, RegisterName{"robot/base"});
  test::expect_answer("ns/register_answer", 9, RegisterNameAnswer{"robot/base", token()});
  test::expect_request("ns/unregister", 10, UnregisterName{});
  test::expect_answer("ns/unregister_answer", 10, UnregisterNameAnswer{token()});
  test::expect_request("ns/let_go", 9, LetGo{"robot/base", token(), 1000});
  test::expect_answer("ns/let_go_answer", 9, LetGoAnswer{});
  test::expect_request("ns/name_lost", 0,
                       NameLost{"robot/base", NodeId{0x00800012}, "it was there first"});
}

TEST(NsRegisterMessages, NeedAName) {
  EXPECT_FALSE(decode<RegisterName>(test::from_hex("01 00 01 00")));
  EXPECT_FALSE(decode<NameLost>(test::from_hex("24 00 00 00")));
}

}  // namespace
}  // namespace gimnet::proto::ns
