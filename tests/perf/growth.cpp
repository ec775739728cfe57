// Tests things that strangers can make the hub look at, in any amount: instructions for each of
// them, counted as those of scripts.cpp, must not grow with the amount. tests/perf/growth_test.py
// compares amounts.
//
//     growth_scripts SCRIPT:COUNT   runs it: once to warm up, then once counted; prints COUNT
//     growth_scripts                prints what compiled it, and the scripts' names

#include <gnu/libc-version.h>

#include <charconv>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/gimi/clerk.hpp"
#include "client/nif/node_parts.hpp"
#include "client/nif/outbound.hpp"
#include "hub/control/state/directory.hpp"
#include "hub/control/state/listing.hpp"
#include "hub/control/state/membership.hpp"
#include "hub/control/state/services.hpp"
#include "hub/control/state/session_token.hpp"
#include "hub/control/table_publisher.hpp"
#include "proto/control/fields.hpp"
#include "proto/control/pattern.hpp"
#include "tests/perf/growth.hpp"

extern "C" {
/// Callgrind counts inside this function, which it finds by its name: it is never inlined.
[[gnu::noinline]] void counted(const std::function<void()>& work) {
  work();
  asm volatile(
      "");  // keeps the call from becoming a jump, which callgrind would not see the end of
}
}

namespace gimnet::hub {

void wrong(const char* what) {
  std::fprintf(stderr, "growth_scripts: %s\n", what);
  std::exit(1);
}

namespace {

using std::chrono::milliseconds;

/// A message of so many values under one key.
Work duplicate_keys(std::size_t count) {
  auto body = std::make_shared<proto::bitestream::Writer>();
  for (std::size_t i = 0; i < count; ++i) body->put_u8(3, 0);
  return [body] {
    const proto::Fields fields(body->bytes(), "message");
    if (fields.failed()) wrong("values under one key are legal");
  };
}

/// The same under keys of 255 bytes, all different at their ends only.
Work long_keys(std::size_t count) {
  auto body = std::make_shared<proto::bitestream::Writer>();
  std::string key(255, 'k');
  for (std::size_t i = 0; i < count; ++i) {
    const std::string number = std::to_string(i);
    key.replace(key.size() - number.size(), number.size(), number);
    body->put_u8(std::string_view{key}, 0);
  }
  return [body] {
    const proto::Fields fields(body->bytes(), "message");
    if (fields.failed()) wrong("long keys are legal");
  };
}

/// Heads of nested values, each of which claims all that is behind it.
Work nested_bomb(std::size_t count) {
  constexpr std::size_t kHeadBytes = 8;
  auto bytes = std::make_shared<std::vector<std::byte>>(count * kHeadBytes);
  for (std::size_t i = 0; i < count; ++i) {
    std::byte* head = bytes->data() + i * kHeadBytes;
    head[0] = std::byte{14 << 3 | 2};  // nested, with a length of 4 bytes
    head[1] = std::byte{3};
    store_le(head + 4, static_cast<std::uint32_t>((count - i - 1) * kHeadBytes));
  }
  return [bytes] {
    const proto::Fields fields(*bytes, "message");
    if (!fields.failed()) wrong("nesting without end is refused");
  };
}

/// Names that hash alike wherever a hash multiplies by 31 or by 33 and adds, one beginning for all.
std::vector<std::string> colliding_names(std::size_t count) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < count; ++i) {
    std::string name = "hall/";
    for (int bit = 0; bit < 20; ++bit) name += (i >> bit & 1) != 0 ? "Aa" : "BB";
    name += '-';
    for (int bit = 0; bit < 20; ++bit) name += (i >> bit & 1) != 0 ? "Ab" : "BA";
    names.push_back(std::move(name));
  }
  return names;
}

Work names(std::size_t count) {
  struct Hub {
    Limits limits;
    Sessions sessions{{}, limits};
    Topics topics{HubId{1}, limits};
    Directory directory{sessions, topics};
  };
  auto hub = std::make_shared<Hub>();
  auto all = std::make_shared<std::vector<std::string>>(colliding_names(count));
  return [hub, all] {
    Directory& directory = hub->directory;
    for (const std::string& name : *all) directory.put(name, NodeIndex{1});
    for (const std::string& name : *all) {
      if (!directory.find(name)) wrong("a name was lost");
    }
    for (const std::string& name : *all) directory.remove(name);
  };
}

/// Names in answers of a hub, for a program that remembers them.
Work remembered_names(std::size_t count) {
  auto all = std::make_shared<std::vector<std::string>>(colliding_names(count));
  return [all] {
    nif::NameCache cache;
    std::uint32_t id = 0;
    for (const std::string& name : *all) {
      cache.remember(name, ++id, 0);
      if (!cache.id_of(name, 0) || !cache.name_of(id, 0)) wrong("a name was forgotten");
    }
  };
}

/// Numbers that a table of so many places has in one of them, wherever a hash is the number itself.
constexpr std::uint32_t kPlaces = 10'273;

/// Destinations that a hub pauses.
Work pauses(std::size_t count) {
  return [count] {
    nif::PauseTable table;
    for (std::uint32_t i = 0; i < count; ++i) {
      table.pause({proto::Kind::unicast, proto::Lane::normal, i * kPlaces}, 0);
      if (!table.is_paused(nif::stream_code(proto::Kind::unicast, 1, i * kPlaces)))
        wrong("it was paused");
    }
  };
}

/// Keys of messages that one node sends, each of which wants an ACK: the numbers of above before a
/// multiplication by the golden section.
Work acks(std::size_t count) {
  constexpr std::uint64_t kInverse = 0xF1DE83E19937733Du;
  static_assert(kInverse * 0x9E3779B97F4A7C15u == 1);
  return [count] {
    gimi::AckBook book;
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::uint64_t key = i * kPlaces * kInverse;
      const gimi::StreamName sender{
          Peer{}, {static_cast<std::uint32_t>(key), static_cast<std::uint32_t>(key >> 32)}, 0};
      if (!book.take(sender, {.sequence = 1}) || book.acknowledge(sender).sequence != 1)
        wrong("it was due");
    }
  };
}

/// Subscribed to by a thousand nodes, so that none of them is at its limit.
Work topics(std::size_t count) {
  struct World {
    Limits limits;
    Topics topics{HubId{7}, limits};
    Services services{topics, limits};
    Effects effects;
  };
  constexpr std::size_t kPerNode = 100;
  auto world = std::make_shared<World>();
  auto all = std::make_shared<std::vector<std::string>>(colliding_names(count));
  return [world, all] {
    for (std::size_t i = 0; i < all->size(); ++i) {
      const NodeIndex node{static_cast<std::uint32_t>(i / kPerNode + 1)};
      if (!world->services.subscribe(node, (*all)[i], {}, world->effects))
        wrong("a subscription was refused");
    }
    for (std::size_t node = 1; node <= all->size() / kPerNode; ++node) {
      world->services.node_left(NodeIndex{static_cast<std::uint32_t>(node)}, milliseconds{0},
                                world->effects);
    }
    world->effects.clear();
  };
}

/// Tokens of which so many bytes of the MAC are right, and the next one is wrong.
Work wrong_tokens(std::size_t count) {
  const Secret secret{};
  const TokenHolder holder{HubId{7}, "robot", Identity::open()};
  auto token = std::make_shared<std::vector<std::byte>>(
      write_token({NodeIndex{1}, 2, milliseconds{3}}, holder, secret));
  constexpr std::size_t kMacBytes = 32;
  if (count > kMacBytes) wrong("a MAC has 32 bytes");
  (*token)[token->size() - kMacBytes + count - 1] ^= std::byte{1};
  return [token, holder, secret, count] {
    for (std::size_t i = 0; i < count; ++i) {
      if (is_genuine(*token, holder, secret)) wrong("a byte of it is wrong");
    }
  };
}

/// Each of so many subscribers of one service ends its subscription and begins it again, and each
/// time the table is published.
Work subscribers(std::size_t count) {
  struct World {
    Limits limits;
    Membership membership{Sessions::Options{HubId{7}, 2, Placement::spread}, limits};
    NodeTable nodes;
    GroupTable groups;
    Quiescence quiescence{2};
    TablePublisher publisher{HubId{7}, 2, {nodes, groups, quiescence}};
    std::vector<NodeIndex> subscribers;
    Effects effects;
  };
  auto world = std::make_shared<World>();
  for (std::size_t i = 0; i <= count; ++i) {
    const auto joined = world->membership.join({}, milliseconds{0}, world->effects);
    if (!joined) wrong("a node was refused");
    world->subscribers.push_back((*joined).session->index);
  }
  Services& services = world->membership.services();
  if (!services.advertise(world->subscribers[0], "robot/odom", {}, milliseconds{0}, world->effects))
    wrong("a service");
  for (std::size_t i = 1; i <= count; ++i) {
    if (!services.subscribe(world->subscribers[i], "robot/odom", {}, world->effects))
      wrong("a subscription");
  }
  world->publisher.publish_group(GroupIndex{1}, world->membership);
  world->publisher.publish_members(GroupIndex{1}, std::span{world->subscribers}.subspan(1),
                                   world->membership);
  world->effects.clear();
  return [world, &services, count] {
    for (std::size_t i = 0; i < count; ++i) {
      // In no order: a step that shares no factor with the number of them.
      const NodeIndex node = world->subscribers[1 + i * 7'919 % count];
      if (services.unsubscribe(node, "robot/odom", {}, world->effects)) wrong("it had subscribed");
      world->publisher.publish_members(GroupIndex{1}, {&node, 1}, world->membership);
      if (!services.subscribe(node, "robot/odom", {}, world->effects))
        wrong("a subscription was refused");
      world->publisher.publish_members(GroupIndex{1}, {&node, 1}, world->membership);
      world->effects.clear();
    }
  };
}

/// Looks for what is in hall-3 among so many names that begin with the same letters, as often.
Work neighbours(std::size_t count) {
  struct World {
    Limits limits;
    Membership membership{Sessions::Options{HubId{7}, 1, Placement::spread}, limits};
  };
  auto world = std::make_shared<World>();
  Effects effects;
  const auto join = [&](const std::string& name) {
    JoinRequest request;
    request.name = name;
    if (!world->membership.join(request, milliseconds{0}, effects)) wrong("a node was refused");
  };
  join("hall-3/robot");
  for (std::size_t i = 0; i < count; ++i)
    join((i % 2 == 0 ? "hall-3-" : "hall-3") + std::to_string(i));
  const auto pattern = proto::Pattern::parse(std::string{"hall-3/"} + '*');
  return [world, pattern, count] {
    const ListingRequest<NodeIndex> request{&*pattern, {}, false, 10, world->limits.scan_records};
    for (std::size_t i = 0; i < count; ++i) {
      if (list_nodes(world->membership, request).indices.size() != 1)
        wrong("one node is in hall-3");
    }
  };
}

/// The pattern with the most ways to fit, and names that fit none of them but at their last part.
Work patterns(std::size_t count) {
  std::string text = "**/a";
  for (int i = 0; i < 7; ++i) text += "/**/a";
  std::string name = "a";
  for (int i = 0; i < 14; ++i) name += "/a";
  const auto pattern = proto::Pattern::parse(text);
  return [pattern, name = name + "/b", count] {
    for (std::size_t i = 0; i < count; ++i) {
      if (pattern->matches(name)) wrong("that name does not fit");
    }
  };
}

/// One comparison with a pattern of so many parts, and a name of as many.
Work pattern_parts(std::size_t count) {
  std::string text = "**";
  std::string name = "a";
  for (std::size_t i = 1; i < count; ++i) {
    text += i % 2 == 0 ? "/**" : "/a";
    name += "/a";
  }
  const auto pattern = proto::Pattern::parse(text);
  if (!pattern) wrong("at most 16 parts");
  name.back() = 'b';
  return [pattern, name] {
    if (pattern->matches(name) != (name.size() == 1)) wrong("that name does not fit");
  };
}

struct Script {
  std::string_view name;
  Work (*make)(std::size_t count);
};

constexpr Script kScripts[] = {
    {"forwarding", forwarding},
    {"duplicate_keys", duplicate_keys},
    {"long_keys", long_keys},
    {"nested_bomb", nested_bomb},
    {"names", names},
    {"topics", topics},
    {"remembered_names", remembered_names},
    {"pauses", pauses},
    {"acks", acks},
    {"wrong_tokens", wrong_tokens},
    {"subscribers", subscribers},
    {"retained", retained},
    {"neighbours", neighbours},
    {"patterns", patterns},
    {"pattern_parts", pattern_parts},
    {"queues", queues},
    {"wait_set", wait_set},
};

int run(std::string_view argument) {
  const std::size_t colon = argument.find(':');
  std::size_t count = 0;
  if (colon != std::string_view::npos) {
    std::from_chars(argument.data() + colon + 1, argument.data() + argument.size(), count);
  }
  for (const Script& script : kScripts) {
    if (count == 0 || argument.substr(0, colon) != script.name) continue;
    const Work work = script.make(count);
    work();
    counted(work);
    std::printf("%zu\n", count);
    return 0;
  }
  wrong("say SCRIPT:COUNT");
}

}  // namespace
}  // namespace gimnet::hub

int main(int argc, char** argv) {
  if (argc > 1) return gimnet::hub::run(argv[1]);
#if defined(__OPTIMIZE__) && defined(NDEBUG)
  const char* const build = "release";
#else
  const char* const build = "other";
#endif
  std::printf("%s %s %s glibc-%s\n", __VERSION__, GIMNET_PROCESSOR, build,
              ::gnu_get_libc_version());
  for (const auto& script : gimnet::hub::kScripts) std::puts(std::string(script.name).c_str());
  return 0;
}
