#include "gimnet/nif_names.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cstddef>
#include <string>
#include <thread>
#include <vector>

#include "proto/control/ctrl.hpp"
#include "proto/control/names.hpp"
#include "proto/control/ns.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

namespace gimnet::nif::test {
namespace {

namespace ns = proto::ns;

/// Runs `ask` in a thread of its own while `answer` plays the hub.
template <class Ask, class Answer>
void converse(Ask ask, Answer answer) {
  std::thread asking(ask);
  answer();
  asking.join();
}

TEST(NifNames, ResolvesOnceAndRemembers) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  converse(
      [node] {
        std::uint32_t id = 0;
        EXPECT_EQ(nif_resolve(node, "robot/base", &id, NIF_FOREVER), NIF_OK);
        EXPECT_EQ(id, kPeerId);
        char name[NIF_NAME_BYTES_MAX + 1];
        EXPECT_EQ(nif_resolve(node, "robot/base", &id, 0), NIF_OK) << "remembered";
        EXPECT_EQ(nif_reverse(node, kPeerId, name, 0), NIF_OK) << "this way, too";
        EXPECT_STREQ(name, "robot/base");
      },
      [&] {
        std::uint16_t number = 0;
        const auto request = connected.hub.next_request<ns::Resolve>(number);
        ASSERT_TRUE(request);
        EXPECT_EQ(request->name, "robot/base");
        connected.hub.send_control(
            proto::Kind::ns, proto::encode_answer(ns::ResolveAnswer{NodeId{kPeerId}}, number));
      });
}

// Whichever of the two the library knows first, the break or the answer, the next connection has
// the service.
TEST(NifNames, AServiceThatIsAnsweredAtABreakIsDeclaredBehindIt) {
  for (int round = 0; round < 50; ++round) {
    FakeHub hub;
    Connected connected = connect_to(hub, default_options(), make_welcome());
    nif_node* const node = connected.node.get();
    nif_service service{};
    service.struct_size = sizeof service;
    service.name = "odom";
    std::uint32_t group = 0;
    std::atomic<int> declared = 0;
    std::atomic<bool> silent = false;  // nothing was declared for as long as the hub has patience
    converse(
        [&] {
          EXPECT_EQ(nif_advertise(node, &service, &group, nullptr, NIF_FOREVER), NIF_OK);
          while (declared == 0 && !silent) std::this_thread::yield();
          connected.node = OpenNode();
        },
        [&] {
          std::uint16_t number = 0;
          ASSERT_TRUE(connected.hub.next_request<ns::Advertise>(number));
          ns::AdvertiseAnswer answer;
          answer.group = GroupId{kOwnId};
          connected.hub.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
          connected.hub.close();
          connected.hub = hub.admit(make_welcome());
          for (; connected.hub.next_request<ns::Advertise>(number); ++declared) {
            connected.hub.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
          }
          silent = true;
          connected.hub.close();
        });
    EXPECT_GT(declared, 0) << "round " << round;
  }
}

TEST(NifNames, TellsWhatTheHubSays) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  converse(
      [node] {
        std::uint32_t id = 0;
        EXPECT_EQ(nif_resolve(node, "nobody", &id, NIF_FOREVER), NIF_NOT_FOUND);
        EXPECT_NE(std::string(nif_error_text()).find("no node has that name"), std::string::npos);
      },
      [&] {
        const auto request = connected.hub.next_message();
        ASSERT_TRUE(request);
        const auto header = proto::split_control(request->view().payload)->header;
        connected.hub.send_control(
            proto::Kind::ns,
            proto::encode_refusal(header, {proto::Status::not_found, "no node has that name"}));
      });
}

TEST(NifNames, ChecksNamesBeforeItAsks) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  std::uint32_t id = 0;
  EXPECT_EQ(nif_resolve(node, "a b", &id, 0), NIF_BAD_NAME);
  EXPECT_EQ(nif_resolve(node, nullptr, &id, 0), NIF_BAD_ARGUMENT);
  EXPECT_EQ(nif_resolve(node, "a", nullptr, 0), NIF_BAD_ARGUMENT);
  for (const char* name : {"", "odom", "robot/*"}) {
    EXPECT_EQ(nif_subscribe(node, name, nullptr, 0), NIF_BAD_NAME) << name;
    EXPECT_EQ(nif_error_text(), std::string("cannot subscribe to '") + name +
                                    "': " + proto::service_full_name_fault(name));
  }
  nif_service service{};
  service.struct_size = sizeof service;
  service.name = "two/parts";
  EXPECT_EQ(nif_advertise(node, &service, &id, nullptr, 0), NIF_BAD_NAME);
  service.name = "one";
  service.direction = 2;
  EXPECT_EQ(nif_advertise(node, &service, &id, nullptr, 0), NIF_BAD_ARGUMENT);
  nif_node_list* list = nullptr;
  EXPECT_EQ(nif_list_nodes(node, "a//b", &list, 0), NIF_BAD_NAME);
}

/// A struct as a program of a later version gives it.
template <class Known>
struct Newer {
  Known known;
  std::uint64_t more;
};

TEST(NifNames, TakesStructuresOfOlderAndNewerPrograms) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  std::uint32_t group = 0;
  Newer<nif_service> service{};
  service.known.struct_size = offsetof(nif_service, window);
  service.known.name = "odom";
  service.known.window = 5;
  nif_pace pace{};
  pace.struct_size = offsetof(nif_pace, rate_hz);
  pace.depth = 3;
  pace.rate_hz = 7.0;
  converse(
      [&] {
        EXPECT_EQ(nif_advertise(node, &service.known, &group, nullptr, NIF_FOREVER), NIF_OK);
        EXPECT_EQ(nif_subscribe_paced(node, "robot/odom", &pace, nullptr, NIF_FOREVER), NIF_OK);
      },
      [&] {
        std::uint16_t number = 0;
        const auto advertised = connected.hub.next_request<ns::Advertise>(number);
        ASSERT_TRUE(advertised);
        EXPECT_EQ(advertised->service, "odom");
        EXPECT_EQ(advertised->window, 0u) << "that is none of its members";
        connected.hub.send_control(
            proto::Kind::ns, proto::encode_answer(ns::AdvertiseAnswer{GroupId{9}, 0}, number));
        const auto subscribed = connected.hub.next_request<ns::Subscribe>(number);
        ASSERT_TRUE(subscribed);
        EXPECT_EQ(subscribed->depth, 3u);
        EXPECT_EQ(subscribed->rate_hz, 0.0) << "that is none of its members";
        connected.hub.send_control(proto::Kind::ns,
                                   proto::encode_answer(ns::SubscribeAnswer{}, number));
      });
  service.known.struct_size = sizeof service;
  service.known.name = "two/parts";
  EXPECT_EQ(nif_advertise(node, &service.known, &group, nullptr, 0), NIF_BAD_NAME)
      << "it asks for nothing there";
  service.more = 1;
  EXPECT_EQ(nif_advertise(node, &service.known, &group, nullptr, 0), NIF_BAD_ARGUMENT);
  pace.struct_size = 0;
  EXPECT_EQ(nif_subscribe_paced(node, "robot/odom", &pace, nullptr, 0), NIF_BAD_ARGUMENT);
}

TEST(NifNames, RequestsHaveALargestContent) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  const std::string content(NIF_REQUEST_BYTES_MAX + 1, 'x');
  nif_reply* reply = nullptr;
  EXPECT_EQ(nif_request(node, NIF_NS, 1, content.data(), NIF_REQUEST_BYTES_MAX, &reply, 0),
            NIF_TIMEOUT);
  EXPECT_EQ(nif_request(node, NIF_NS, 1, content.data(), NIF_REQUEST_BYTES_MAX + 1, &reply, 0),
            NIF_BAD_ARGUMENT);
}

TEST(NifNames, ListsAllPages) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  converse(
      [node] {
        nif_node_list* list = nullptr;
        ASSERT_EQ(nif_list_nodes(node, "robot/**", &list, NIF_FOREVER), NIF_OK);
        ASSERT_EQ(list->count, 2u);
        EXPECT_EQ(list->records[1].id, 3u);
        EXPECT_STREQ(list->records[0].name, "robot/2");
        EXPECT_STREQ(list->records[0].place, "");
        nif_free_nodes(list);
      },
      [&] {
        std::uint16_t number = 0;
        std::uint32_t id = 0;
        for (const bool more : {true, true, false}) {
          const auto request = connected.hub.next_request<ns::List>(number);
          ASSERT_TRUE(request);
          EXPECT_EQ(request->pattern, "robot/**");
          EXPECT_EQ(request->after.value(), id);
          ns::ListAnswer answer;
          answer.more = more;
          answer.nodes.resize(1);
          answer.nodes[0].node = NodeId{++id};
          answer.nodes[0].name = "robot/" + std::to_string(id);
          if (more && id == 1)
            answer.nodes.clear();  // the hub looked at many, and none of them fits
          answer.next = NodeId{id};
          connected.hub.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
        }
      });
}

TEST(NifNames, DoesNotFollowAHubThatPagesForEver) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  converse(
      [node] {
        nif_service_list* list = nullptr;
        EXPECT_EQ(nif_list_services(node, nullptr, &list, NIF_FOREVER), NIF_PROTOCOL);
        EXPECT_EQ(list, nullptr);
      },
      [&] {
        std::uint16_t number = 0;
        for (int i = 0; i < 2; ++i) {
          ASSERT_TRUE(connected.hub.next_request<ns::ServicesRequest>(number));
          ns::ServicesAnswer answer;
          answer.more = true;
          answer.services.resize(1);
          answer.services[0].group = GroupId{5};
          answer.next = GroupId{5};
          connected.hub.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
        }
      });
}

TEST(NifNames, GivesRawAnswersOut) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  converse(
      [node] {
        nif_reply* reply = nullptr;
        EXPECT_EQ(nif_request(node, NIF_CTRL, 0x8001, nullptr, 0, &reply, 0), NIF_BAD_ARGUMENT);
        EXPECT_EQ(nif_request(node, 16, 1, nullptr, 0, &reply, 0), NIF_BAD_ARGUMENT);
        ASSERT_EQ(nif_request(node, NIF_CTRL, NIF_CTRL_HUB_INFO, nullptr, 0, &reply, NIF_FOREVER),
                  NIF_OK);
        EXPECT_EQ(reply->status, 0);
        EXPECT_GT(reply->size, 0u);
        nif_free_reply(reply);
        nif_free_reply(nullptr);
      },
      [&] {
        std::uint16_t number = 0;
        ASSERT_TRUE(connected.hub.next_request<proto::ctrl::HubInfo>(number));
        connected.hub.send_control(proto::Kind::ctrl,
                                   proto::encode_answer(proto::ctrl::HubInfoAnswer{}, number));
      });
}

TEST(NifNames, AsksAgainAfterABreak) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  converse(
      [&] {
        EXPECT_EQ(nif_subscribe(node, "peer/scan", nullptr, NIF_FOREVER), NIF_OK);
        connected.node = OpenNode();
      },
      [&] {
        std::uint16_t number = 0;
        ASSERT_TRUE(connected.hub.next_request<ns::Subscribe>(number));
        connected.hub.close();
        connected.hub = hub.admit(make_welcome());
        while (connected.hub.next_request<ns::Subscribe>(number)) {
          connected.hub.send_control(proto::Kind::ns,
                                     proto::encode_answer(ns::SubscribeAnswer{}, number));
        }
        connected.hub.close();
      });
}

TEST(NifNames, IgnoresAnswersToNothing) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  connected.hub.send_control(proto::Kind::ns,
                             proto::encode_answer(ns::ResolveAnswer{NodeId{1}}, 55));
  std::uint32_t id = 0;
  EXPECT_EQ(nif_resolve(connected.node.get(), "late", &id, 1), NIF_TIMEOUT);
  std::uint16_t number = 0;
  ASSERT_TRUE(connected.hub.next_request<ns::Resolve>(number));
  connected.hub.send_control(proto::Kind::ns, proto::encode_answer(ns::WithdrawAnswer{}, number));
  connected.hub.send_control(proto::Kind::ns,
                             proto::encode_answer(ns::ResolveAnswer{NodeId{1}}, number));
  connected.hub.send_unicast(kPeerId, kOwnId, "still there");
  nif_incoming in;
  ASSERT_EQ(nif_receive(connected.node.get(), &in, NIF_FOREVER), NIF_OK);
  EXPECT_EQ(payload_of(in), "still there");
  nif_release(&in);
}

/// Services that a hub refused have it, until a hub takes them.
TEST(NifNames, NoServiceHasTheGroupZero) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  EXPECT_EQ(nif_withdraw(connected.node.get(), 0, 0), NIF_BAD_ARGUMENT);
}

TEST(NifNames, AFailedCallLeavesItsOutputEmpty) {
  const auto garbage = [](auto* any) { return reinterpret_cast<decltype(any)>(std::uintptr_t{8}); };
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  for (nif_node* const node : {connected.node.get(), static_cast<nif_node*>(nullptr)}) {
    auto* reply = garbage(static_cast<nif_reply*>(nullptr));
    EXPECT_NE(nif_request(node, NIF_NS, 1, nullptr, 5, &reply, 0), NIF_OK);
    EXPECT_EQ(reply, nullptr);
    auto* nodes = garbage(static_cast<nif_node_list*>(nullptr));
    EXPECT_NE(nif_list_nodes(node, "a//b", &nodes, 0), NIF_OK);
    EXPECT_EQ(nodes, nullptr);
    auto* services = garbage(static_cast<nif_service_list*>(nullptr));
    EXPECT_NE(nif_list_services(node, "a//b", &services, 0), NIF_OK);
    EXPECT_EQ(services, nullptr);
  }
}

}  // namespace
}  // namespace gimnet::nif::test
