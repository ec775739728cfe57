#include "tools/gimnet/missed_afar.hpp"

#include <gtest/gtest.h>

#include "base/ids.hpp"

namespace gimnet::tool {
namespace {

ServiceRecord service(std::uint32_t hub, std::uint32_t index, std::uint64_t missed = 0,
                      Peer most = {}) {
  ServiceRecord record;
  record.group_id = make_id<GroupId>(HubId{static_cast<std::uint16_t>(hub)}, index).value();
  record.missed = missed;
  record.missed_most = most;
  return record;
}

TEST(MissedAfar, AddsWhatEachHubTells) {
  const Peer near{1u << 20 | 5};
  const Peer far{2u << 20 | 6};
  std::vector<ServiceRecord> services{service(1, 1, 7, near), service(2, 1), service(3, 1)};
  services[0].subscribers = 4;
  std::vector<std::uint64_t> most{7, 0, 0};
  std::vector<ServiceRecord> told{service(1, 1, 9, far), service(2, 1, 1, far), service(9, 9, 5)};
  told[0].subscribers = 1;
  told[1].subscribers = 30;
  add_answer(services, most, 2, told);
  EXPECT_EQ(services[0].missed, 16u);
  EXPECT_EQ(services[0].missed_most, far);
  EXPECT_EQ(services[0].subscribers, 4u) << "its own hub knows";
  EXPECT_EQ(services[1].missed, 1u);
  EXPECT_EQ(services[1].subscribers, 30u);
  EXPECT_EQ(services[2].missed, 0u);
  ASSERT_EQ(services.size(), 3u) << "others were not asked for";
  add_answer(services, most, 3, {service(1, 1, 8, Peer{3u << 20 | 7})});
  EXPECT_EQ(services[0].missed, 24u);
  EXPECT_EQ(services[0].missed_most, far) << "9 are more than 8";
}

}  // namespace
}  // namespace gimnet::tool
