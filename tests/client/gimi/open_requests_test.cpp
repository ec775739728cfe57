#include "client/gimi/open_requests.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "client/gimi/answer_queue.hpp"
#include "gimnet/gimi.hpp"
#include "proto/control/ns.hpp"
#include "tests/client/gimi/support/conversation.hpp"
#include "tests/client/gimi/support/hub_process.hpp"

// Requests between two nodes by a hub: each way in which one ends, and whether it was done.

namespace gimnet {
namespace {

using gimi::AnswerQueue;
using gimi::OpenRequests;
using test::HubProcess;
using test::kPatience;

constexpr Timeout kWait = std::chrono::duration_cast<Timeout>(kPatience);

class OpenRequestsTest : public testing::Test {
 protected:
  HubProcess hub_;
  std::optional<Node> calc_{Node("calc", hub_.url())};
  std::optional<Answers> add_{calc_->answer("add").or_throw()};
  Node asker_{"", hub_.url()};
};

TEST_F(OpenRequestsTest, AReplyComesToWhoAsked) {
  std::thread answering([&] {
    for (int i = 0; i < 2; ++i) {
      auto request = add_->receive(kWait).or_throw();
      EXPECT_EQ(request.from(), asker_.peer());
      EXPECT_GT(request.left(), Timeout{0});
      request.reply("sum of " + std::string(request.text())).or_throw();
      EXPECT_TRUE(request.reply("twice").is(Status::closed));
    }
  });
  const Reply reply = asker_.request("calc/add", "1 2", kWait);
  EXPECT_TRUE(reply) << reply.failure().sentence;
  EXPECT_EQ(reply.text(), "sum of 1 2");
  EXPECT_EQ(reply.from(), calc_->peer());
  EXPECT_EQ(reply.ran(), Ran::yes);
  const std::string large(std::size_t{1} << 20, 'x');
  EXPECT_EQ(asker_.request("calc/add", large, kWait).data().size(), large.size() + 7);
  answering.join();
}

TEST_F(OpenRequestsTest, TheOtherProgramsErrorSpeaksForItself) {
  std::thread answering([&] { add_->receive(kWait).or_throw().fail(-7, "no numbers").or_throw(); });
  const Reply reply = asker_.request("calc/add", "a", kWait);
  EXPECT_TRUE(reply.is(Status::failed));
  EXPECT_EQ(reply.code(), -7);
  EXPECT_EQ(reply.failure().sentence, "calc/add: no numbers");
  EXPECT_EQ(reply.ran(), Ran::yes);
  answering.join();
}

TEST_F(OpenRequestsTest, OneThatTheProgramLetsGoMayHaveBeenDone) {
  std::thread answering([&] { static_cast<void>(add_->receive(kWait).or_throw()); });
  const Reply reply = asker_.request("calc/add", "", kWait);
  EXPECT_TRUE(reply.is(Status::gone));
  EXPECT_EQ(reply.ran(), Ran::maybe);
  answering.join();
}

TEST_F(OpenRequestsTest, ANameIsThatOfOneService) {
  for (const char* service : {"", "*", "calc", "calc/*", "a//b"}) {
    const Reply reply = asker_.request(service, "", kWait);
    EXPECT_TRUE(reply.is(Status::bad_name)) << service;
    EXPECT_EQ(reply.failure().sentence.find("cannot ask '"), 0u) << reply.failure().sentence;
    EXPECT_EQ(reply.ran(), Ran::no);
  }
}

TEST_F(OpenRequestsTest, ASenderIsToldToAsk) {
  EXPECT_EQ(asker_.sender("calc/add").failure().sentence,
            "cannot send to 'calc/add': it answers questions and takes no data; ask it by "
            "request()");
  const PendingReply asked = asker_.request_later("calc/add", "", kWait).or_throw();
  EXPECT_TRUE(asker_.sender("calc/add").is(Status::not_found)) << "also once it was asked";
}

TEST_F(OpenRequestsTest, WhoAsksForDataIsToldToSubscribe) {
  const Publisher odom = calc_->advertise("odom").or_throw();
  EXPECT_EQ(asker_.request("calc/odom", "", kWait).failure().sentence,
            "cannot ask calc/odom: it gives data and answers nothing; subscribe to it");
  EXPECT_EQ(asker_.request("calc/nothing", "", kWait).failure().sentence,
            "cannot ask calc/nothing: nobody answers there at the moment");
}

TEST_F(OpenRequestsTest, NobodyAnswersThere) {
  const Queue drive = calc_->accept("drive").or_throw();
  const Publisher odom = calc_->advertise("odom").or_throw();
  for (const char* service : {"calc/multiply", "nobody/add", "calc/drive", "calc/odom"}) {
    const auto begin = std::chrono::steady_clock::now();
    const Reply reply = asker_.request(service, "", kWait);
    EXPECT_TRUE(reply.is(Status::not_found)) << service << ": " << reply.failure().sentence;
    EXPECT_EQ(reply.ran(), Ran::no) << service;
    EXPECT_LT(std::chrono::steady_clock::now() - begin,
              std::chrono::nanoseconds(OpenRequests::kRetryForNs))
        << "it is said at once";
  }
}

TEST_F(OpenRequestsTest, TooManyThatWaitAreRefused) {
  std::vector<PendingReply> pending;
  for (std::size_t i = 0; i <= AnswerQueue::kWaitingMax; ++i)
    pending.push_back(asker_.request_later("calc/add", "", kWait).or_throw());
  const auto refused = pending.back().wait(kWait);
  ASSERT_TRUE(refused);
  EXPECT_TRUE(refused->is(Status::busy)) << refused->failure().sentence;
  EXPECT_EQ(refused->ran(), Ran::no);
  EXPECT_FALSE(pending.front().wait(kNoWait));
  EXPECT_TRUE(add_->receive(kWait).or_throw().reply("first"));
  EXPECT_EQ(pending.front().wait(kWait)->text(), "first");
}

TEST_F(OpenRequestsTest, ItsTimeIsOver) {
  const auto pending = asker_.request_later("calc/add", "first", Timeout{50}).or_throw();
  const Reply reply = asker_.request("calc/add", "second", Timeout{200});
  EXPECT_TRUE(reply.is(Status::timeout));
  EXPECT_EQ(reply.ran(), Ran::maybe);
  // The first came before the second, and its time was over long ago.
  const auto taken = add_->receive(kNoWait);
  EXPECT_TRUE(!taken || taken->text() == "second") << "what is too late is not given out";
}

TEST_F(OpenRequestsTest, TheProgramEnds) {
  const auto pending = asker_.request_later("calc/add", "", kWait).or_throw();
  const auto request = add_->receive(kWait).or_throw();
  calc_.reset();
  const auto reply = pending.wait(kWait);
  ASSERT_TRUE(reply);
  EXPECT_TRUE(reply->is(Status::gone)) << reply->failure().sentence;
  EXPECT_EQ(reply->ran(), Ran::maybe);
}

TEST_F(OpenRequestsTest, TheServiceEndsBeforeTheRequestIsTaken) {
  const auto pending = asker_.request_later("calc/add", "", kWait).or_throw();
  EXPECT_FALSE(pending.wait(Timeout{20}));
  add_.reset();
  const auto reply = pending.wait(kWait);
  ASSERT_TRUE(reply);
  EXPECT_TRUE(reply->is(Status::not_found) || reply->is(Status::gone));
}

TEST_F(OpenRequestsTest, TheOwnNodeIsClosed) {
  const auto pending = asker_.request_later("calc/add", "", kWait).or_throw();
  asker_.close();
  const auto reply = pending.wait(kWait);
  ASSERT_TRUE(reply);
  EXPECT_TRUE(reply->is(Status::closed));
  EXPECT_EQ(reply->ran(), Ran::maybe);
  EXPECT_TRUE(asker_.request("calc/add").is(Status::closed));
}

TEST_F(OpenRequestsTest, AnotherProgramOfThatNameIsAskedNext) {
  std::optional<PendingReply> pending(asker_.request_later("calc/add", "", kWait).or_throw());
  static_cast<void>(add_->receive(kWait).or_throw().reply("first"));
  EXPECT_EQ(pending->wait(kWait)->text(), "first");
  add_.reset();
  calc_.reset();
  const Node other("calc", hub_.url());
  const Answers answers = other.answer("add").or_throw();
  std::thread answering([&] { answers.receive(kWait).or_throw().reply("other").or_throw(); });
  // The asking node may hear a moment later that the former one is gone, and of the other one.
  std::string text;
  EXPECT_TRUE(test::eventually([&] {
    const Reply reply = asker_.request("calc/add", "", kWait);
    text = reply.text();
    return reply || !(reply.is(Status::not_found) || reply.is(Status::gone));
  }));
  EXPECT_EQ(text, "other");
  answering.join();
}

TEST(OpenRequests, OneThatIsCancelledSaysWhetherItWasDone) {
  gimi::Uplink uplink;
  OpenRequests requests(uplink, [] {});
  const std::uint32_t number = requests.open("calc/add", {}, INT64_MAX, {}).or_throw();
  const std::atomic<bool> left{true};
  EXPECT_EQ(requests.wait(number, INT64_MAX, &left)->ran, Ran::no) << "it was never sent";
  requests.cancel(number);
  EXPECT_EQ(requests.wait(number, INT64_MAX, &left)->ran, Ran::maybe);
}

TEST_F(OpenRequestsTest, ManyAtOnceGetTheirOwnReplies) {
  constexpr int kThreads = 4;
  constexpr int kRequests = 200;
  std::atomic<bool> over = false;
  std::thread answering([&] {
    while (!over) {
      auto request = add_->receive(Timeout{50});
      if (request) static_cast<void>(request->reply(std::string(request->text())));
    }
  });
  std::vector<std::thread> asking;
  for (int thread = 0; thread < kThreads; ++thread) {
    asking.emplace_back([&, thread] {
      for (int i = 0; i < kRequests; ++i) {
        const std::string text = std::to_string(thread) + "/" + std::to_string(i);
        const Reply reply = asker_.request("calc/add", text, kWait);
        EXPECT_EQ(reply.text(), text) << reply.failure().sentence;
      }
    });
  }
  for (auto& thread : asking) thread.join();
  over = true;
  answering.join();
}

namespace ns = proto::ns;
using gimi::test::kPeerId;
using gimi::test::MessageOperation;
using proto::gimi::kFlagAgain;

/// A node that asks, and the hub's end of its connection. Its session is not resumed after a break.
class RequestsAtAFakeHub : public gimi::test::Conversation {
 protected:
  static constexpr std::uint32_t kGroup = (7u << 20) | 11;
  static constexpr std::uint64_t kSession = 5;

  RequestsAtAFakeHub() : Conversation(true) {}
  ~RequestsAtAFakeHub() override {
    if (asking_.joinable()) asking_.join();
    hub_.close();
  }

  void ask(bool repeat = false) {
    asking_ = std::thread([this, repeat] {
      reply_.emplace(node_->request("calc/add", "1 2", kWait, {.repeat = repeat}));
    });
  }
  const Reply& reply() {
    if (asking_.joinable()) asking_.join();
    return *reply_;
  }

  template <class Request>
  [[nodiscard]] std::uint16_t take() {
    std::uint16_t number = 0;
    EXPECT_TRUE(hub_.next_request<Request>(number));
    return number;
  }
  template <class Answer>
  void tell(std::uint16_t number, const Answer& answer) {
    hub_.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
  }
  void answer_listing(bool is_there) {
    ns::ServicesAnswer listed;
    if (is_there) {
      ns::ServiceRecord record;
      record.group = GroupId{kGroup};
      record.name = "calc/add";
      record.direction = ns::Direction::accepts;
      record.message_type = proto::gimi::kRequestType;
      listed.services.push_back(record);
    }
    tell(take<ns::ServicesRequest>(), listed);
  }
  void answer_subscribe(std::uint64_t session = kSession) {
    ns::SubscribeAnswer place;
    place.group = GroupId{kGroup};
    place.provider = NodeId{kPeerId};
    place.session = session;
    place.message_type = proto::gimi::kRequestType;
    place.direction = ns::Direction::accepts;
    tell(take<ns::Subscribe>(), place);
  }
  /// Nobody has the node's name.
  void answer_resolve(bool learning) {
    const std::uint16_t number = take<ns::Resolve>();
    hub_.send_control(proto::Kind::ns, proto::encode_refusal({ns::Resolve::kOperation, number},
                                                             {proto::Status::not_found,
                                                              "no node has the name", learning}));
  }

  /// The next message is the request; 20 s of its time are left, or nearly.
  gimi::test::Frame next_request() {
    const auto frame = hub_.next_message();
    const gimi::test::Taken taken = taken_of(*frame);
    EXPECT_EQ(taken.header.operation, MessageOperation::request);
    EXPECT_EQ(taken.frame.dst, kGroup);
    EXPECT_EQ(taken.data.substr(proto::gimi::kRequestPrefix), "1 2");
    sequence_ = taken.header.sequence;
    flags_ = taken.header.flags;
    return *frame;
  }
  /// It was asked, and the hub has its first copy.
  gimi::test::Frame begin(bool repeat = false) {
    ask(repeat);
    answer_listing(true);
    answer_subscribe();
    return next_request();
  }
  void break_connection() {
    hub_.close();
    hub_ = fake_.admit(nif::test::make_welcome());
  }
  void refuse(proto::gimi::RequestFault fault) {
    answer({sequence_, MessageOperation::error, 0, 0},
           proto::gimi::encode_request_error({fault, 0, ""}));
  }

  std::uint32_t sequence_ = 0;
  std::uint8_t flags_ = 0;

 private:
  std::thread asking_;
  std::optional<Reply> reply_;
};

TEST_F(RequestsAtAFakeHub, AfterABreakARequestIsNamedAgainAndMayHaveBeenDone) {
  begin();
  EXPECT_EQ(flags_, 0);
  const std::uint32_t first = sequence_;
  break_connection();
  answer_subscribe();
  next_request();
  EXPECT_EQ(sequence_, first);
  EXPECT_EQ(flags_, kFlagAgain);
  refuse(proto::gimi::RequestFault::busy);
  EXPECT_TRUE(reply().is(Status::busy));
  EXPECT_EQ(reply().ran(), Ran::maybe) << "the first one may have come";
}

TEST_F(RequestsAtAFakeHub, ADropOfTheSecondSaysNothingOfTheFirst) {
  begin();
  break_connection();
  answer_subscribe();
  report(proto::DropReason::queue_full, 1, next_request());
  EXPECT_TRUE(reply().is(Status::not_delivered));
  EXPECT_EQ(reply().ran(), Ran::maybe);
}

TEST_F(RequestsAtAFakeHub, OneThatFoundNoWayIsSentAgainAndWasNotDone) {
  report(proto::DropReason::no_such_group, 1, begin());
  const auto second = next_request();
  EXPECT_EQ(flags_, 0) << "the first one did not come";
  report(proto::DropReason::queue_full, 1, second);
  EXPECT_TRUE(reply().is(Status::not_delivered));
  EXPECT_EQ(reply().ran(), Ran::no);
}

TEST_F(RequestsAtAFakeHub, ALinkThatBrokeLeavesItOpenWhetherItWasDone) {
  report(proto::DropReason::link_unsure, 1, begin());
  EXPECT_TRUE(reply().is(Status::not_delivered));
  EXPECT_EQ(reply().ran(), Ran::maybe);
}

TEST_F(RequestsAtAFakeHub, AnotherSessionUnderTheSameGroupIsAnotherProgram) {
  begin();
  break_connection();
  answer_subscribe(kSession + 1);
  EXPECT_TRUE(reply().is(Status::gone));
  EXPECT_EQ(reply().ran(), Ran::maybe);
}

TEST_F(RequestsAtAFakeHub, OneThatMayBeDoneTwiceIsAskedOfTheNextProgram) {
  begin(true);
  break_connection();
  answer_subscribe(kSession + 1);
  next_request();
  EXPECT_EQ(flags_, kFlagAgain | proto::gimi::kFlagRepeat);
  answer({sequence_, MessageOperation::reply, 0, 0}, std::as_bytes(std::span("3", 1)));
  EXPECT_EQ(reply().text(), "3") << reply().failure().sentence;
}

TEST_F(RequestsAtAFakeHub, NobodyIsSaidWhenNoNameIsOnItsWay) {
  ask();
  for (const bool learning : {true, true, false}) {
    answer_listing(false);
    answer_resolve(learning);
  }
  EXPECT_TRUE(reply().is(Status::not_found));
  EXPECT_EQ(reply().ran(), Ran::no);
}

TEST_F(RequestsAtAFakeHub, RepliesThatNobodyAskedForAreDroppedAndCounted) {
  begin();
  answer({sequence_ + 1, MessageOperation::reply, 0, 0}, {});
  answer({sequence_, MessageOperation::reply, 0, 0, epoch_ + 1}, {});
  answer({sequence_, MessageOperation::reply, 0, 0}, {}, kPeerId + 1);
  answer({sequence_, MessageOperation::reply, 0, 0}, std::as_bytes(std::span("3", 1)));
  answer({sequence_, MessageOperation::reply, 0, 0}, {});
  EXPECT_EQ(reply().text(), "3");
  EXPECT_TRUE(gimnet::test::eventually([&] { return node_->dropped() == 4; }));
}

}  // namespace
}  // namespace gimnet
