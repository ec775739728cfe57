// Round trips are those of NIF, with its callback: messages are seen to on the library's thread.
// Bursts, requests and what those are compared with are GIMI's, whose messages wait in queues.

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "gimnet/gimi.hpp"
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
    if (setup.is_burst) {
      open_queue(setup);
      return;
    }
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
    if (sender_) {
      sender_->send(payload).or_throw();
      return;
    }
    check(nif_send_to(node_.load(), partner_.load(std::memory_order_relaxed), payload.data(),
                      payload.size()),
          "send");
  }

  void answer(const Setup& setup) override {
    const Node& node = join(setup);
    const Answers answers = node.answer("echo").or_throw();
    std::thread([answers] {
      for (;;) {
        auto request = answers.receive().or_throw();
        request.reply(request.text()).or_throw();
      }
    }).detach();
    const Queue queue = node.queue(kPlain);
    std::thread([&node, queue] {
      for (;;) {
        const Message message = queue.receive().or_throw();
        node.sender(message.from(), {.key = kPlain}).or_throw().send(message.text()).or_throw();
      }
    }).detach();
  }

  void begin_asking(const Setup& setup) override {
    const Node& node = join(setup);
    service_ = setup.partner + "/echo";
    queue_.emplace(node.queue(kPlain));
    connect_to(node.find(setup.partner).or_throw());
  }

  void ask(std::span<const std::byte> payload) override {
    const Reply reply = gimi_->request(service_, payload, kPatience);
    if (!reply) fail("ask: " + reply.failure().sentence);
    if (!is_same(payload, reply.data().data(), reply.data().size())) fail("another reply came");
  }

  void send_round(std::span<const std::byte> payload) override {
    sender_->send(payload).or_throw();
    const Message message = queue_->receive(kPatience).or_throw();
    if (!is_same(payload, message.data().data(), message.size())) fail("another message came");
  }

 private:
  static constexpr MessageKey kPlain{1, 0};
  static constexpr Timeout kPatience{kPatienceMs};
  static constexpr std::size_t kQueueMessages = 32'768;  ///< more than are under way

  const Node& join(const Setup& setup) {
    NodeOptions options;
    options.hub = setup.url;
    options.name = setup.own;
    options.keep_token = false;
    options.resume = false;  // as above
    return gimi_.emplace(Node::join(options).or_throw());
  }

  void open_queue(const Setup& setup) {
    const Node& node = join(setup);
    if (!setup.is_first) connect_to(node.find(setup.partner).or_throw());
    std::thread([this, queue = node.queue(kPlain, {.messages = kQueueMessages})] {
      while (const auto message = queue.receive()) {  // until the node is closed
        if (!sender_) connect_to(message->from());
        on_message_(message->data());
      }
    }).detach();
  }

  void connect_to(Peer partner) {
    sender_.emplace(gimi_->sender(partner, {.key = kPlain}).or_throw());
  }

  void take(const nif_incoming& in) {
    if (in.type != NIF_MESSAGE) return;
    if (partner_.load(std::memory_order_relaxed) != in.from) partner_.store(in.from);
    on_message_({static_cast<const std::byte*>(in.payload), in.size});
  }

  std::atomic<nif_node*> node_{nullptr};  ///< read by the library's thread, too
  OnMessage on_message_;
  std::atomic<std::uint32_t> partner_{0};  ///< no partner: a number by itself

  std::optional<Node> gimi_;
  std::string service_;
  std::optional<Queue> queue_;
  std::optional<Sender> sender_;
};

}  // namespace

std::unique_ptr<LibraryClient> make_library_client() { return std::make_unique<NifClient>(); }

}  // namespace gimnet::perf
