#include "generator/engine.hpp"

#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

namespace gimnet::perf {
namespace {

constexpr std::size_t kReadBytes = 256 * 1024;
/// The longest incomplete message that is carried over to the next read.
constexpr std::size_t kCarryBytesMax = 2 * 1024 * 1024;
constexpr std::size_t kEventsMax = 512;
/// Clients that may wait for their admission at a time.
constexpr std::size_t kJoiningMax = 64;
constexpr std::chrono::milliseconds kKeepAlive{900};

}  // namespace

Engine::Engine(Wire& wire, const std::string& url)
    : wire_(wire),
      address_(address_of(url)),
      epoll_(::epoll_create1(EPOLL_CLOEXEC)),
      buffer_(std::make_unique<std::byte[]>(kCarryBytesMax + kReadBytes)),
      next_keep_alive_(Clock::now() + kKeepAlive) {}

Engine::~Engine() {
  clients_.clear();
  ::close(epoll_);
}

void Engine::connect(std::size_t count) {
  for (std::size_t begun = 0; begun < count; ++begun) {
    clients_.push_back(std::make_unique<Client>(clients_.size(), connect_to(address_)));
    watch(*clients_.back(), EPOLL_CTL_ADD, EPOLLIN);
    wire_.open(*clients_.back());
    const bool room = poll_until(
        [this] { return clients_.size() - wire_.joined_count() < kJoiningMax; }, answer_limit());
    if (!room) fail("the subject admits nobody any more");
  }
  const bool all =
      poll_until([this] { return wire_.joined_count() == clients_.size(); }, answer_limit());
  if (!all) fail("the subject did not admit all clients in time");
}

void Engine::watch(Client& client, int operation, std::uint32_t events) const {
  epoll_event event{};
  event.events = events;
  event.data.ptr = &client;
  if (::epoll_ctl(epoll_, operation, client.socket(), &event) != 0) fail("epoll_ctl", errno);
}

void Engine::join_group(std::size_t first_subscriber, std::size_t count) {
  Client& provider = client(0);
  if (!provider.is_in_group) {
    wire_.provide(provider);
    if (!poll_until([&provider] { return provider.is_in_group; }, answer_limit()))
      fail("no answer to ADVERTISE");
  }
  for (std::size_t index = first_subscriber; index < first_subscriber + count; ++index) {
    Client& subscriber = client(index);
    wire_.subscribe(subscriber);
    // Not a round trip each: every so many the last one's answer is waited for.
    if (index % kJoiningMax != 0) continue;
    if (!poll_until([&subscriber] { return subscriber.is_in_group; }, answer_limit()))
      fail("no answer to SUBSCRIBE");
  }
  const auto all_in_group = [this, first_subscriber, count] {
    return std::all_of(clients_.begin() + static_cast<std::ptrdiff_t>(first_subscriber),
                       clients_.begin() + static_cast<std::ptrdiff_t>(first_subscriber + count),
                       [](const auto& client) { return client->is_in_group; });
  };
  if (!poll_until(all_in_group, answer_limit()))
    fail("the subject did not answer every SUBSCRIBE in time");
}

std::uint64_t Engine::poll(std::chrono::nanoseconds timeout) {
  if (Clock::now() >= next_keep_alive_) keep_alive();
  std::array<epoll_event, kEventsMax> events;
  const timespec wait{.tv_sec = timeout.count() / 1'000'000'000,
                      .tv_nsec = timeout.count() % 1'000'000'000};
  const int count = ::epoll_pwait2(epoll_, events.data(), kEventsMax, &wait, nullptr);
  if (count < 0 && errno != EINTR) fail("epoll_pwait2", errno);
  std::uint64_t settled = 0;
  for (int index = 0; index < count; ++index) {
    Client& ready = *static_cast<Client*>(events[static_cast<std::size_t>(index)].data.ptr);
    const std::uint64_t before = ready.inbox.settled();
    read(ready);
    settled += ready.inbox.settled() - before;
  }
  return settled;
}

bool Engine::poll_until(const std::function<bool()>& done, std::chrono::nanoseconds limit) {
  const auto deadline = Clock::now() + limit;
  while (!done()) {
    if (Clock::now() >= deadline) return false;
    poll(std::chrono::milliseconds(5));
  }
  return true;
}

void Engine::stop_reading(Client& client) { watch(client, EPOLL_CTL_MOD, 0); }

void Engine::close(Client& client) {
  client.is_closed = true;
  client.close();  // which takes it out of the epoll, too
}

Engine::Counts Engine::counts() const {
  Counts counts;
  for (const auto& client : clients_) {
    counts.delivered += client->inbox.delivered();
    counts.lost += client->inbox.lost();
    counts.wrong += client->inbox.wrong();
  }
  return counts;
}

void Engine::read(Client& client) {
  if (client.is_closed) return on_closed(client);
  auto& carry = client.carry();
  if (carry.size() > kCarryBytesMax) fail("a message without an end");
  std::memcpy(buffer_.get(), carry.data(), carry.size());
  const ssize_t size = ::recv(client.socket(), buffer_.get() + carry.size(), kReadBytes, 0);
  if (size < 0 && (errno == EAGAIN || errno == EINTR)) return;
  if (size <= 0) return on_closed(client);
  const std::span<const std::byte> bytes(buffer_.get(),
                                         carry.size() + static_cast<std::size_t>(size));
  const auto rest = bytes.subspan(wire_.take(client, bytes));
  carry.assign(rest.begin(), rest.end());
}

void Engine::on_closed(Client& client) {
  if (!is_closing_tolerated_)
    fail("the subject closed the connection of client " + std::to_string(client.index()));
  client.is_closed = true;
  watch(client, EPOLL_CTL_DEL, 0);
}

void Engine::keep_alive() {
  next_keep_alive_ = Clock::now() + kKeepAlive;
  for (auto& client : clients_) {
    if (client->is_joined && !client->is_closed) wire_.keep_alive(*client);
  }
}

}  // namespace gimnet::perf
