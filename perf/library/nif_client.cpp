// NIF, with its callback: messages are seen to on the library's thread.

#include <atomic>
#include <string>
#include <utility>

#include "gimnet/nif.h"
#include "library/library_client.hpp"
#include "net/socket.hpp"

namespace gimnet::perf {
namespace {

constexpr std::int32_t kPatienceMs = 30'000;

void check(nif_status status, const char* what) {
  if (status != NIF_OK) fail(std::string(what) + ": " + nif_error_text());
}

class NifClient final : public LibraryClient {
 public:
  ~NifClient() override { static_cast<void>(nif_close(node_.load())); }

  void open(const Setup& setup, OnMessage on_message) override {
    on_message_ = std::move(on_message);
    nif_options options{};
    options.struct_size = sizeof options;
    options.url = setup.url.c_str();
    options.name = setup.own.c_str();
    options.connect_timeout_ms = kPatienceMs;
    options.no_token_file = 1;
    options.resume = NIF_RESUME_OFF;  // as the others: what breaks with a connection is lost
    options.callback = [](void* self, const nif_incoming* in) {
      static_cast<NifClient*>(self)->take(*in);
      return NIF_DONE;
    };
    options.user = this;
    nif_node* node = nullptr;
    check(nif_connect(&options, &node), "connect");
    node_.store(node);
    if (setup.is_first) return;
    std::uint32_t id = 0;
    check(nif_resolve(node, setup.partner.c_str(), &id, kPatienceMs), "find the partner");
    partner_.store(id);
  }

  void send(std::span<const std::byte> payload) override {
    check(nif_send_to(node_.load(), partner_.load(std::memory_order_relaxed), payload.data(),
                      payload.size()),
          "send");
  }

 private:
  void take(const nif_incoming& in) {
    if (in.type != NIF_MESSAGE) return;
    if (partner_.load(std::memory_order_relaxed) != in.from) partner_.store(in.from);
    on_message_({static_cast<const std::byte*>(in.payload), in.size});
  }

  std::atomic<nif_node*> node_{nullptr};  ///< read by the library's thread, too
  OnMessage on_message_;
  std::atomic<std::uint32_t> partner_{0};  ///< no partner: a number by itself
};

}  // namespace

std::unique_ptr<LibraryClient> make_library_client() { return std::make_unique<NifClient>(); }

}  // namespace gimnet::perf
