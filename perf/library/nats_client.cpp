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
    natsConnection_Destroy(connection_);
  }

  void open(const Setup& setup, OnMessage on_message) override {
    on_message_ = std::move(on_message);
    partner_ = setup.partner;
    if (!setup.url.starts_with("tcp://")) fail("nats.c has no Unix sockets");
    natsOptions* options = nullptr;
    check(natsOptions_Create(&options), "options");
    check(natsOptions_SetURL(options, ("nats" + setup.url.substr(3)).c_str()), "url");
    check(natsOptions_SetSendAsap(options, !setup.is_bursty), "send at once");
    check(natsConnection_Connect(&connection_, options), "connect");
    natsOptions_Destroy(options);
    check(natsConnection_Subscribe(&subscription_, connection_, setup.own.c_str(), on_nats_message,
                                   this),
          "subscribe");
    check(natsSubscription_SetPendingLimits(subscription_, -1, -1),
          "lift the limits of what may wait");
    check(natsConnection_Flush(connection_), "wait until it is subscribed");
  }

  void send(std::span<const std::byte> payload) override {
    check(natsConnection_Publish(connection_, partner_.c_str(), payload.data(),
                                 static_cast<int>(payload.size())),
          "publish");
  }

 private:
  static void on_nats_message(natsConnection*, natsSubscription*, natsMsg* message, void* self) {
    const auto* data = reinterpret_cast<const std::byte*>(natsMsg_GetData(message));
    static_cast<NatsClient*>(self)->on_message_(
        {data, static_cast<std::size_t>(natsMsg_GetDataLength(message))});
    natsMsg_Destroy(message);
  }

  natsConnection* connection_ = nullptr;
  natsSubscription* subscription_ = nullptr;
  std::string partner_;
  OnMessage on_message_;
};

}  // namespace

std::unique_ptr<LibraryClient> make_library_client() { return std::make_unique<NatsClient>(); }

}  // namespace gimnet::perf
