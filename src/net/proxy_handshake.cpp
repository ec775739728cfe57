#include "net/proxy_handshake.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "base/check.hpp"

namespace gimnet::net {
namespace {

/// RFC 4648.
std::string base64(std::string_view text) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string coded;
  for (std::size_t i = 0; i < text.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t j = i; j < i + 3; ++j)
      bits = bits << 8 | (j < text.size() ? static_cast<unsigned char>(text[j]) : 0u);
    for (std::size_t digit = 0; digit < 4; ++digit)
      coded += i + digit > text.size() ? '=' : kDigits[bits >> (18 - 6 * digit) & 63];
  }
  return coded;
}

constexpr std::string_view kTcp = "tcp://";
constexpr std::string_view kShape = "HTTP/1.0 000";  ///< a status line's begin; 0: any digit
constexpr std::size_t kCodeAt = 9;

/// May a status line have this byte there?
bool fits(std::size_t at, char byte) {
  if (at > kShape.size()) return true;
  if (at == kShape.size()) return byte == ' ' || byte == '\r' || byte == '\n';
  return kShape[at] == '0' ? byte >= '0' && byte <= '9' : byte == kShape[at];
}

/// `403 Forbidden`, for people.
std::string status_of(std::string_view answer) {
  constexpr std::size_t kShownMax = 100;
  std::string text(answer.substr(kCodeAt, answer.find_first_of("\r\n") - kCodeAt));
  text.resize(std::min(text.size(), kShownMax));
  while (text.ends_with(' ')) text.pop_back();
  std::ranges::replace_if(text, [](char byte) { return byte < ' ' || byte > '~'; }, '?');
  return text;
}

}  // namespace

ProxyHandshake::ProxyHandshake(const ProxyAddress& proxy, const Address& to)
    : proxy_(proxy), to_(to.url().substr(kTcp.size())) {
  GIMNET_ASSERT(to.scheme == Address::Scheme::tcp);
}

std::string ProxyHandshake::request() const {
  std::string text = "CONNECT " + to_ + " HTTP/1.1\r\nHost: " + to_ + "\r\n";
  if (!proxy_.user.empty())
    text += "Proxy-Authorization: Basic " + base64(proxy_.user + ":" + proxy_.password) + "\r\n";
  return text + "\r\n";
}

ProxyHandshake::State ProxyHandshake::take(std::byte byte) {
  GIMNET_ASSERT(state_ == State::need_more);
  const char letter = static_cast<char>(byte);
  if (!fits(answer_.size(), letter)) return fail("it does not speak HTTP; is it an HTTP proxy?");
  if (answer_.size() == kAnswerBytesMax)
    return fail("its answer to CONNECT is longer than 8 KiB; is it an HTTP proxy?");
  answer_ += letter;
  const bool ended = answer_.ends_with("\n\r\n") || answer_.ends_with("\n\n");
  return ended ? judge() : State::need_more;
}

ProxyHandshake::State ProxyHandshake::fail(std::string sentence) {
  error_.sentence = std::move(sentence);
  return state_ = State::failed;
}

ProxyHandshake::State ProxyHandshake::judge() {
  const std::string said = status_of(answer_);
  const int code = (said[0] - '0') * 100 + (said[1] - '0') * 10 + (said[2] - '0');
  if (code >= 200 && code < 300) return state_ = State::open;
  return fail(refusal(code, said));
}

std::string ProxyHandshake::refusal(int code, const std::string& said) const {
  const std::string answers = "it answers '" + said + "'";
  switch (code) {
    case 401:
    case 407:
      return answers + (proxy_.user.empty()
                            ? ": it wants a user and a password; write them into its URL, "
                              "http://USER:PASSWORD@" +
                                  proxy_.place()
                            : ": user or password is wrong; correct them in its URL");
    case 403:
      return answers + ": it may not connect to " + to_ +
             "; ask its administrator to allow CONNECT to that port, or let the hub listen on one "
             "that is allowed, often 443";
    case 405:
    case 501:
      return answers + ": it does not take CONNECT; name an HTTP proxy that does";
    case 500:
    case 502:
    case 503:
    case 504:
      return answers + ": it cannot reach " + to_ + "; is the hub running there?";
    default:
      return answers + " to CONNECT " + to_ + "; ask its administrator";
  }
}

}  // namespace gimnet::net
