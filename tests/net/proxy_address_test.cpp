#include "net/proxy_address.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::net {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::string fault(std::string_view url) {
  const Result<ProxyAddress> proxy = parse_proxy(url);
  return proxy ? "" : proxy.error().sentence;
}

TEST(ProxyAddress, IsTakenApart) {
  EXPECT_EQ(*parse_proxy("http://proxy.lab:3128"), (ProxyAddress{"proxy.lab", 3128, "", ""}));
  EXPECT_EQ(*parse_proxy("http://10.0.0.1:8080/"), (ProxyAddress{"10.0.0.1", 8080, "", ""}));
  EXPECT_EQ(*parse_proxy("http://[::1]:65535"), (ProxyAddress{"::1", 65535, "", ""}));
  EXPECT_EQ(*parse_proxy("http://ann:p@ss:w%2Frd%25@p:1"),
            (ProxyAddress{"p", 1, "ann", "p@ss:w/rd%"}));
  EXPECT_EQ(*parse_proxy("http://ann@p:1"), (ProxyAddress{"p", 1, "ann", ""}));
}

TEST(ProxyAddress, SaysWhatIsWrong) {
  EXPECT_EQ(fault("https://p:1"),
            "cannot use the proxy 'https://p:1': its URL does not begin with http://; write "
            "http://HOST:PORT or http://USER:PASSWORD@HOST:PORT");
  EXPECT_THAT(fault(""), HasSubstr("does not begin with http://"));
  EXPECT_THAT(fault("http://p\n:1"), HasSubstr("'...': there are control characters"));
  EXPECT_THAT(fault("http://proxy.lab"), HasSubstr("the port is missing"));
  EXPECT_THAT(fault("http://[::1]"), HasSubstr("the port is missing"));
  EXPECT_THAT(fault("http://:3128"), HasSubstr("host is not understood"));
  EXPECT_THAT(fault("http://::1:3128"), HasSubstr("host is not understood"));
  EXPECT_THAT(fault("http://a b:3128"), HasSubstr("host is not understood"));
  for (const char* port : {"", "0", "65536", "-1", "80x"})
    EXPECT_THAT(fault(std::string("http://p:") + port), HasSubstr("1 to 65535")) << port;
  for (const char* login : {":secret", "ann:%", "ann:%g0", "ann:%0a", "a%3Ab:c"})
    EXPECT_THAT(fault(std::string("http://") + login + "@p:1"), HasSubstr("user or password"));
}

TEST(ProxyAddress, LeadsToNoUnixSocket) {
  EXPECT_EQ(proxy_towards(*parse_address("tcp://h:1"), "http://p:1")->port, 1);
  EXPECT_FALSE(proxy_towards(*parse_address("tcp://h:1"), "p:1"));
  EXPECT_THAT(proxy_towards(*parse_address("unix:/s"), "http://p:1").error().sentence,
              HasSubstr("no proxy reaches unix:/s"));
}

TEST(ProxyAddress, NeverShowsAPassword) {
  for (const char* url : {"http://p:1", "http://ann@p:1", "http://[::1]:80"})
    EXPECT_EQ(parse_proxy(url)->shown(), url);
  EXPECT_EQ(parse_proxy("http://ann:secret@p:1")->shown(), "http://ann:***@p:1");
  EXPECT_EQ(shown_proxy("http://p:1"), "http://p:1");
  EXPECT_EQ(shown_proxy("http://ann@p:1"), "http://ann@p:1");
  EXPECT_EQ(shown_proxy("http://ann:secret@p:1"), "http://ann:***@p:1");
  EXPECT_EQ(shown_proxy("http://ann:se@cr:et/@p:1"), "http://ann:***@p:1");
  EXPECT_EQ(shown_proxy("ann:secret@p:1"), "ann:***@p:1");
  for (const char* url : {"https://ann:secret@p:1", "http://ann:secret@p", "ann:secret@p",
                          "http://ann:secret%@p:1", "http:/ann:secret@p:1"})
    EXPECT_THAT(fault(url), Not(HasSubstr("secret"))) << url;
}

}  // namespace
}  // namespace gimnet::net
