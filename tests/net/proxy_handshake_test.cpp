#include "net/proxy_handshake.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace gimnet::net {
namespace {

using State = ProxyHandshake::State;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

ProxyHandshake handshake(const std::string& proxy = "http://p:1",
                         const std::string& to = "tcp://hub.lab:7450") {
  return {*parse_proxy(proxy), *parse_address(to)};
}

/// Gives it the text byte by byte, as far as it takes any.
State feed(ProxyHandshake& handshake, const std::string& text) {
  for (const char byte : text) {
    if (handshake.state() != State::need_more) break;
    handshake.take(static_cast<std::byte>(byte));
  }
  return handshake.state();
}

/// The sentence about that answer.
std::string fault(const std::string& answer, const std::string& proxy = "http://p:1") {
  ProxyHandshake asked = handshake(proxy);
  EXPECT_EQ(feed(asked, answer), State::failed) << answer;
  EXPECT_EQ(asked.error().fault, Fault::no_peer);
  return asked.error().sentence;
}

std::string status(int code, const std::string& proxy = "http://p:1") {
  return fault("HTTP/1.1 " + std::to_string(code) + " Word\r\n\r\n", proxy);
}

TEST(ProxyHandshake, AsksForATunnel) {
  EXPECT_EQ(handshake().request(), "CONNECT hub.lab:7450 HTTP/1.1\r\nHost: hub.lab:7450\r\n\r\n");
  EXPECT_EQ(handshake("http://p:1", "tcp://[::1]:7").request(),
            "CONNECT [::1]:7 HTTP/1.1\r\nHost: [::1]:7\r\n\r\n");
}

TEST(ProxyHandshake, ShowsUserAndPasswordAsRfc7617Says) {
  const auto line = [](const std::string& proxy) {
    const std::string request = handshake(proxy).request();
    const std::size_t begin = request.find("Proxy-Authorization: ");
    return request.substr(begin, request.find("\r\n", begin) - begin);
  };
  // The examples of RFC 7617, and every length of what is left over.
  EXPECT_EQ(line("http://Aladdin:open%20sesame@p:1"),
            "Proxy-Authorization: Basic QWxhZGRpbjpvcGVuIHNlc2FtZQ==");
  EXPECT_EQ(line("http://a:b@p:1"), "Proxy-Authorization: Basic YTpi");
  EXPECT_EQ(line("http://a:bc@p:1"), "Proxy-Authorization: Basic YTpiYw==");
  EXPECT_EQ(line("http://a:bcd@p:1"), "Proxy-Authorization: Basic YTpiY2Q=");
  EXPECT_EQ(line("http://ann@p:1"), "Proxy-Authorization: Basic YW5uOg==");
}

TEST(ProxyHandshake, TakesEverySuccessUpToTheEmptyLine) {
  for (const char* answer :
       {"HTTP/1.1 200 Connection established\r\n\r\n", "HTTP/1.0 200 OK\r\nVia: tinyproxy\r\n\r\n",
        "HTTP/1.1 204\r\n\r\n", "HTTP/1.1 200 \n\n", "HTTP/1.1 299\nA: b\n\n"}) {
    ProxyHandshake asked = handshake();
    const std::string whole = answer;
    EXPECT_EQ(feed(asked, whole.substr(0, whole.size() - 1)), State::need_more) << answer;
    EXPECT_EQ(asked.take(static_cast<std::byte>(whole.back())), State::open) << answer;
  }
}

TEST(ProxyHandshake, LeavesAtTheFirstByteThatIsNotHttp) {
  for (const char* garbage : {"GIMNET", "HTTP/2", "HTTP/1.x", "HTTP/1.1  ", "HTTP/1.1 20x",
                              "HTTP/1.1 2000", "\r\n", "SSH-2.0-OpenSSH"}) {
    EXPECT_EQ(fault(garbage), "it does not speak HTTP; is it an HTTP proxy?") << garbage;
  }
  std::string zeros = "HTTP/1.1 200";
  zeros += '\0';
  EXPECT_THAT(fault(zeros), HasSubstr("does not speak HTTP"));
}

TEST(ProxyHandshake, TakesNoAnswerWithoutEnd) {
  std::string answer = "HTTP/1.1 200 OK\r\nX: ";
  ProxyHandshake asked = handshake();
  EXPECT_EQ(feed(asked, answer + std::string(ProxyHandshake::kAnswerBytesMax - answer.size(), 'x')),
            State::need_more);
  EXPECT_EQ(asked.take(std::byte{'x'}), State::failed);
  EXPECT_THAT(asked.error().sentence, HasSubstr("longer than 8 KiB"));
}

TEST(ProxyHandshake, SaysWhatARefusalMeansAndTheRemedy) {
  EXPECT_EQ(status(407),
            "it answers '407 Word': it wants a user and a password; write them into its URL, "
            "http://USER:PASSWORD@p:1");
  EXPECT_EQ(status(407, "http://ann:secret@p:1"),
            "it answers '407 Word': user or password is wrong; correct them in its URL");
  EXPECT_THAT(status(401), HasSubstr("it wants a user and a password"));
  EXPECT_THAT(status(403), AllOf(HasSubstr("may not connect to hub.lab:7450"),
                                 HasSubstr("ask its administrator"), HasSubstr("often 443")));
  for (const int code : {405, 501})
    EXPECT_THAT(status(code), HasSubstr("does not take CONNECT; name an HTTP proxy that does"));
  for (const int code : {500, 502, 503, 504})
    EXPECT_THAT(status(code), HasSubstr("cannot reach hub.lab:7450; is the hub running there?"));
  for (const int code : {100, 199, 300, 404, 999})
    EXPECT_THAT(status(code), HasSubstr("to CONNECT hub.lab:7450; ask its administrator"));
}

TEST(ProxyHandshake, ShowsLittleAndOnlyWhatCanBePrinted) {
  const std::string words =
      fault("HTTP/1.1 403 \x1b[31m\xff" + std::string(4'000, 'a') + "\r\n\r\n");
  EXPECT_THAT(words, HasSubstr("'403 ?[31m?aaa"));
  EXPECT_LT(words.size(), 400u);
  for (const int code : {200, 403, 407, 500, 700}) {
    ProxyHandshake asked = handshake("http://ann:secret@p:1");
    feed(asked, "HTTP/1.1 " + std::to_string(code) + "\r\n\r\n");
    EXPECT_THAT(asked.error().sentence, Not(HasSubstr("secret")));
  }
}

}  // namespace
}  // namespace gimnet::net
