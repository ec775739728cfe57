// A ZeroMQ hub to measure against: the XPUB/XSUB proxy of the ZeroMQ guide ("The Dynamic Discovery
// Problem").
//
//     zeromq_proxy --subscribe tcp://127.0.0.1:0 --subscribe ipc:///path --publish
//     tcp://127.0.0.1:0 --publish ipc:///path
//
// Prints `ready SUBSCRIBE_URL... PUBLISH_URL...` when it listens. Nothing is dropped: a full queue
// holds the publisher up.

#include <sys/resource.h>
#include <zmq.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

namespace {

constexpr int kQueueMessages = 100'000;

void check(bool good, const char* what) {
  if (good) return;
  std::fprintf(stderr, "zeromq_proxy: %s: %s\n", what, zmq_strerror(zmq_errno()));
  std::exit(1);
}

void set(void* socket, int option, int value) {
  check(zmq_setsockopt(socket, option, &value, sizeof(value)) == 0, "setsockopt");
}

/// Binds, and appends to `ready` the addresses that it got.
void listen_on(void* socket, const std::vector<std::string>& urls, std::string& ready) {
  for (const auto& url : urls) {
    check(zmq_bind(socket, url.c_str()) == 0, url.c_str());
    char address[256];
    std::size_t size = sizeof(address);
    check(zmq_getsockopt(socket, ZMQ_LAST_ENDPOINT, address, &size) == 0, "getsockopt");
    const std::string text(address, size - 1);
    ready += " " + (text.starts_with("ipc://") ? "unix:" + text.substr(6) : text);
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"zeromq_proxy: XPUB and XSUB with a proxy between"};
  std::vector<std::string> subscribe_urls;
  std::vector<std::string> publish_urls;
  app.add_option("--subscribe", subscribe_urls, "where subscribers connect, repeatable")
      ->required();
  app.add_option("--publish", publish_urls, "where publishers connect, repeatable")->required();
  CLI11_PARSE(app, argc, argv);

  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) == 0) {
    limit.rlim_cur = limit.rlim_max;
    ::setrlimit(RLIMIT_NOFILE, &limit);
  }
  void* const context = zmq_ctx_new();
  check(context != nullptr, "context");
  void* const publishers = zmq_socket(context, ZMQ_XSUB);
  void* const subscribers = zmq_socket(context, ZMQ_XPUB);
  check(publishers != nullptr && subscribers != nullptr, "socket");
  for (void* const socket : {publishers, subscribers}) {
    set(socket, ZMQ_SNDHWM, kQueueMessages);
    set(socket, ZMQ_RCVHWM, kQueueMessages);
    set(socket, ZMQ_BACKLOG, 4096);
  }
  set(subscribers, ZMQ_XPUB_NODROP, 1);
  std::string ready = "ready";
  listen_on(subscribers, subscribe_urls, ready);
  listen_on(publishers, publish_urls, ready);
  std::puts(ready.c_str());
  std::fflush(stdout);
  zmq_proxy(publishers, subscribers, nullptr);
}
