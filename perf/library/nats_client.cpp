// nats.c: a subscription of its own with its thread. Single messages are sent at once (SendAsap),
// bursts are gathered by the library, which is its default.

#include <nats/nats.h>

#include <string>
#include <utility>

#include "library/library_client.hpp"
#include "net/socket.hpp"

namespace gimnet::perf {
namespace {

void check(natsStatus status, const char* what) {
  if (status != NATS_OK) fail(std::string(what) + ": " + natsStatus_GetText(status));
}

class NatsClient final : public LibraryClient {
 public:
  ~NatsClient() override {
    natsSubscription_Destroy(subscription_);
    natsSubscription_Destroy(requests_);
    natsConnection_Destroy(connection_);
  }

  void open(const Setup& setup, OnMessage on_message) override {
    on_message_ = std::move(on_message);
    connect(setup);
    subscribe_to(setup.own, &subscription_, on_nats_message);
  }

  void send(std::span<const std::byte> payload) override {
    check(natsConnection_Publish(connection_, partner_.c_str(), payload.data(),
                                 static_cast<int>(payload.size())),
          "publish");
  }

  void answer(const Setup& setup) override {
    open(setup, [this](std::span<const std::byte> message) { send(message); });
    subscribe_to(
        setup.own + ".request", &requests_,
        [](natsConnection* connection, natsSubscription*, natsMsg* message, void*) {
          check(natsConnection_Publish(connection, natsMsg_GetReply(message),
                                       natsMsg_GetData(message), natsMsg_GetDataLength(message)),
                "reply");
          natsMsg_Destroy(message);
        });
  }

  void begin_asking(const Setup& setup) override {
    connect(setup);
    request_ = setup.partner + ".request";
    check(natsConnection_SubscribeSync(&subscription_, connection_, setup.own.c_str()),
          "subscribe");
    check(natsConnection_Flush(connection_), "wait until it is subscribed");
  }

  void ask(std::span<const std::byte> payload) override {
    natsMsg* reply = nullptr;
    check(natsConnection_Request(&reply, connection_, request_.c_str(), payload.data(),
                                 static_cast<int>(payload.size()), kPatienceMs),
          "ask");
    compare(payload, reply);
  }

  void send_round(std::span<const std::byte> payload) override {
    send(payload);
    natsMsg* message = nullptr;
    check(natsSubscription_NextMsg(&message, subscription_, kPatienceMs), "receive");
    compare(payload, message);
  }

 private:
  static constexpr std::int64_t kPatienceMs = 30'000;

  static void compare(std::span<const std::byte> sent, natsMsg* message) {
    const auto size = static_cast<std::size_t>(natsMsg_GetDataLength(message));
    if (!is_same(sent, natsMsg_GetData(message), size)) fail("another message came");
    natsMsg_Destroy(message);
  }

  void connect(const Setup& setup) {
    partner_ = setup.partner;
    if (!setup.url.starts_with("tcp://")) fail("nats.c has no Unix sockets");
    natsOptions* options = nullptr;
    check(natsOptions_Create(&options), "options");
    check(natsOptions_SetURL(options, ("nats" + setup.url.substr(3)).c_str()), "url");
    check(natsOptions_SetSendAsap(options, !setup.is_bursty), "send at once");
    check(natsConnection_Connect(&connection_, options), "connect");
    natsOptions_Destroy(options);
  }

  void subscribe_to(const std::string& subject, natsSubscription** subscription,
                    natsMsgHandler handler) {
    check(natsConnection_Subscribe(subscription, connection_, subject.c_str(), handler, this),
          "subscribe");
    check(natsSubscription_SetPendingLimits(*subscription, -1, -1),
          "lift the limits of what may wait");
    check(natsConnection_Flush(connection_), "wait until it is subscribed");
  }

  static void on_nats_message(natsConnection*, natsSubscription*, natsMsg* message, void* self) {
    const auto* data = reinterpret_cast<const std::byte*>(natsMsg_GetData(message));
    static_cast<NatsClient*>(self)->on_message_(
        {data, static_cast<std::size_t>(natsMsg_GetDataLength(message))});
    natsMsg_Destroy(message);
  }

  natsConnection* connection_ = nullptr;
  natsSubscription* subscription_ = nullptr;
  natsSubscription* requests_ = nullptr;
  std::string request_;  ///< the subject of the partner
  std::string partner_;
  OnMessage on_message_;
};

}  // namespace

std::unique_ptr<LibraryClient> make_library_client() { return std::make_unique<NatsClient>(); }

}  // namespace gimnet::perf
