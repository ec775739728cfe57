#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hub/control/state/services.hpp"
#include "proto/control/ns.hpp"

namespace gimnet::hub {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr NodeIndex kRobot{1};
constexpr NodeIndex kViewer{2};
constexpr NodeIndex kOther{4};

class ServicesMovedTest : public ::testing::Test {
 protected:
  /// Another message type, and so another group.
  GroupIndex advertise(std::uint32_t type, const std::string& name = "robot/odom",
                       GroupIndex former_group = kNoGroup) {
    ServiceTerms terms;
    terms.message_type = type;
    terms.delivery = proto::ns::Delivery::sync;
    terms.window = 3;
    const GroupProof proof = write_group_proof({HubId{7}, former_group, name}, {});
    const auto done =
        services_.advertise(kRobot, name, terms, now_, effects_, {former_group, proof});
    EXPECT_TRUE(done);
    return done ? done->group : kNoGroup;
  }
  void subscribe(const std::string& name = "robot/odom") {
    EXPECT_TRUE(services_.subscribe(kViewer, name, {}, effects_));
  }
  /// What the node is told at its return, if that is one service.
  ServiceMovedDue told(NodeIndex node = kViewer) {
    const std::vector<ServiceMovedDue> all = services_.untold_moves(node);
    EXPECT_EQ(all.size(), 1u);
    return all.empty() ? ServiceMovedDue{} : all.front();
  }
  std::uint64_t last_move() const {
    std::uint64_t move = 0;
    for (const Effect& effect : effects_) {
      if (const auto* moved = std::get_if<ServiceMovedDue>(&effect))
        move = std::max(move, moved->move);
    }
    return move;
  }

  Limits limits_;
  Services services_{HubId{7}, limits_};
  Effects effects_;
  std::chrono::milliseconds now_{0};
};

TEST_F(ServicesMovedTest, WhoHasReadItsEventsIsToldNothing) {
  EXPECT_THAT(services_.untold_moves(kViewer), IsEmpty());
  advertise(5);
  subscribe();
  EXPECT_THAT(services_.untold_moves(kViewer), IsEmpty()) << "the answer told";
  advertise(6);
  EXPECT_EQ(services_.untold_moves(kViewer).size(), 1u);
  services_.moves_read(kViewer, last_move() - 1);
  EXPECT_EQ(services_.untold_moves(kViewer).size(), 1u);
  services_.moves_read(kViewer, last_move());
  EXPECT_THAT(services_.untold_moves(kViewer), IsEmpty());
  services_.moves_read(kOther, last_move());
}

TEST_F(ServicesMovedTest, SeveralMovesAreToldAsOneWithWhatIsTrueNow) {
  const GroupIndex known = advertise(5);
  subscribe();
  const GroupIndex between = advertise(6);
  EXPECT_EQ(services_.withdraw(kRobot, between, now_, effects_), std::nullopt);
  const GroupIndex present = advertise(7);
  const ServiceMovedDue event = told();
  EXPECT_THAT(event.subscribers, ElementsAre(kViewer));
  EXPECT_EQ(event.full_name, "robot/odom");
  EXPECT_EQ(event.old_group, known);
  EXPECT_EQ(event.new_group, present);
  EXPECT_THAT(event.between, ElementsAre(between));
  EXPECT_EQ(event.message_type, 7u);
  EXPECT_EQ(event.window, 3u);
  EXPECT_EQ(event.move, last_move());
  EXPECT_TRUE(event.again);
}

TEST_F(ServicesMovedTest, AServiceThatIsGoneIsToldAsGone) {
  const GroupIndex known = advertise(5);
  subscribe();
  EXPECT_EQ(services_.withdraw(kRobot, known, now_, effects_), std::nullopt);
  EXPECT_EQ(told().old_group, known);
  EXPECT_EQ(told().new_group, kNoGroup);
  EXPECT_EQ(told().window, 0u);
}

TEST_F(ServicesMovedTest, AnIdThatIsAnotherServicesNowIsNotTakenFromThat) {
  const GroupIndex known = advertise(5);
  subscribe();
  const GroupIndex between = advertise(6);
  advertise(7);
  now_ += std::chrono::hours{1};  // long enough at rest
  EXPECT_EQ(advertise(5, "robot/laser", known), known);
  EXPECT_EQ(advertise(5, "robot/scan", between), between);
  EXPECT_EQ(told().old_group, kNoGroup);
  EXPECT_THAT(told().between, IsEmpty());
}

TEST_F(ServicesMovedTest, AServiceThatHasItsFormerGroupAgainIsThere) {
  const GroupIndex known = advertise(5);
  subscribe();
  EXPECT_EQ(services_.withdraw(kRobot, known, now_, effects_), std::nullopt);
  now_ += std::chrono::hours{1};
  EXPECT_EQ(advertise(5, "robot/odom", known), known);
  EXPECT_EQ(told().old_group, kNoGroup);
  EXPECT_EQ(told().new_group, known);
}

TEST_F(ServicesMovedTest, GoesWithTheSubscriptionAndWithTheNode) {
  advertise(5);
  subscribe();
  advertise(6);
  services_.node_renumbered(kViewer, kOther, effects_);
  EXPECT_THAT(services_.untold_moves(kViewer), IsEmpty());
  EXPECT_THAT(told(kOther).subscribers, ElementsAre(kOther));
  EXPECT_EQ(services_.unsubscribe(kOther, "robot/odom", effects_), std::nullopt);
  EXPECT_TRUE(services_.subscribe(kOther, "robot/odom", {}, effects_));
  EXPECT_THAT(services_.untold_moves(kOther), IsEmpty()) << "the answer told";
}

TEST_F(ServicesMovedTest, ASubscriptionThatIsDeclaredAgainDoesNotProveThatTheEventWasRead) {
  const GroupIndex known = advertise(5);
  subscribe();
  advertise(6);
  services_.node_returned(kViewer);
  subscribe();
  EXPECT_EQ(told().old_group, known) << "its answer may be lost with this connection, too";
}

}  // namespace
}  // namespace gimnet::hub
