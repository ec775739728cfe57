// libmosquitto at QoS 0. Its loop runs in the main thread, so that a publish writes by itself and
// wakes nobody: with a thread of its own every publish would also write to a pipe.

#include <mosquitto.h>

#include <algorithm>
#include <cerrno>
#include <string>
#include <utility>

#include "library/library_client.hpp"
#include "net/socket.hpp"

namespace gimnet::perf {
namespace {

constexpr int kKeepAliveSeconds = 60;
constexpr int kLoopMsMax = 100;
constexpr std::chrono::seconds kPatience{10};

void check(int code, const char* what) {
  if (code == MOSQ_ERR_ERRNO) fail(what, errno);
  if (code != MOSQ_ERR_SUCCESS) fail(std::string(what) + ": " + mosquitto_strerror(code));
}

class MosquittoClient final : public LibraryClient {
 public:
  ~MosquittoClient() override {
    mosquitto_destroy(mosquitto_);
    mosquitto_lib_cleanup();
  }

  void open(const Setup& setup, OnMessage on_message) override {
    on_message_ = std::move(on_message);
    partner_ = setup.partner;
    check(mosquitto_lib_init(), "begin");
    mosquitto_ = mosquitto_new(nullptr, true, this);
    if (mosquitto_ == nullptr) fail("no memory");
    check(mosquitto_int_option(mosquitto_, MOSQ_OPT_TCP_NODELAY, 1), "TCP_NODELAY");
    mosquitto_message_callback_set(
        mosquitto_, [](mosquitto*, void* self, const mosquitto_message* message) {
          const auto* data = static_cast<const std::byte*>(message->payload);
          static_cast<MosquittoClient*>(self)->on_message_(
              {data, static_cast<std::size_t>(message->payloadlen)});
        });
    mosquitto_subscribe_callback_set(mosquitto_, [](mosquitto*, void* self, int, int, const int*) {
      static_cast<MosquittoClient*>(self)->wake();
    });
    // tcp://HOST:PORT, or unix:PATH with port 0.
    const bool is_unix = setup.url.starts_with("unix:");
    const std::size_t end = is_unix ? setup.url.size() : setup.url.rfind(':');
    const std::string place = setup.url.substr(is_unix ? 5 : 6, end - (is_unix ? 5 : 6));
    const int port = is_unix ? 0 : std::stoi(setup.url.substr(end + 1));
    check(mosquitto_connect(mosquitto_, place.c_str(), port, kKeepAliveSeconds), "connect");
    check(mosquitto_subscribe(mosquitto_, nullptr, setup.own.c_str(), 0), "subscribe");
    if (!wait(Clock::now() + kPatience)) fail("the hub did not answer the subscription in time");
  }

  void send(std::span<const std::byte> payload) override {
    check(mosquitto_publish(mosquitto_, nullptr, partner_.c_str(), static_cast<int>(payload.size()),
                            payload.data(), 0, false),
          "publish");
  }

  bool wait(Clock::time_point deadline) override {
    while (!woken_) {
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now());
      if (left.count() <= 0) return false;
      const int timeout_ms = static_cast<int>(std::min<std::int64_t>(left.count(), kLoopMsMax));
      check(mosquitto_loop(mosquitto_, timeout_ms, 1), "go on");
    }
    woken_ = false;
    return true;
  }

  void wake() override { woken_ = true; }

 private:
  mosquitto* mosquitto_ = nullptr;
  std::string partner_;
  OnMessage on_message_;
  bool woken_ = false;
};

}  // namespace

std::unique_ptr<LibraryClient> make_library_client() { return std::make_unique<MosquittoClient>(); }

}  // namespace gimnet::perf
