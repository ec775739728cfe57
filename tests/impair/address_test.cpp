#include "impair/address.hpp"

#include <gtest/gtest.h>

namespace gimnet::impair {
namespace {

TEST(Address, NamesTheFormThatIsMissing) {
  EXPECT_EQ(wrong_form_of("tcp://127.0.0.1:7450"), "");
  EXPECT_EQ(wrong_form_of("tcp://[::1]:0"), "");
  EXPECT_EQ(wrong_form_of("unix:/tmp/x"), "");
  EXPECT_EQ(wrong_form_of("127.0.0.1:0"),
            "'127.0.0.1:0' is no address: write tcp://HOST:PORT or unix:PATH");
  for (const char* url : {"tcp://127.0.0.1", "tcp://:7450", "tcp://127.0.0.1:", "tcp://"})
    EXPECT_NE(wrong_form_of(url).find("lacks the host or the port"), std::string::npos) << url;
  EXPECT_EQ(wrong_form_of("unix:"), "'unix:' has no path: write tcp://HOST:PORT or unix:PATH");
}

TEST(Address, APathMayHave107Bytes) {
  EXPECT_EQ(wrong_form_of("unix:" + std::string(107, 'x')), "");
  EXPECT_NE(wrong_form_of("unix:" + std::string(108, 'x')), "");
}

TEST(Address, FindsFamiliesByTheirForm) {
  EXPECT_EQ(find_address("tcp://127.0.0.1:1")->bytes.ss_family, AF_INET);
  EXPECT_EQ(find_address("tcp://[::1]:1")->bytes.ss_family, AF_INET6);
  EXPECT_EQ(find_address("unix:/tmp/x")->bytes.ss_family, AF_UNIX);
}

TEST(Address, NamesTheHostThatIsNotFound) {
  const auto found = find_address("tcp://no host:1");
  ASSERT_FALSE(found);
  EXPECT_TRUE(found.error().sentence.starts_with("'tcp://no host:1' cannot be found: "));
}

}  // namespace
}  // namespace gimnet::impair
