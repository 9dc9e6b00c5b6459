#include "acquire/discovery.h"

#include <gmock/gmock.h>

#include "tests/acquire/array_fixture.h"

namespace flamefield {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(Discovery, TwoCamerasAtOneAddressAreBothNamed) {
  std::vector<DiscoveredCamera> found = {
      {"192.168.7.10", "02:00:c0:a8:07:0a", "Basler", "acA645", "21000001", {}},
      {"192.168.7.11", "02:00:c0:a8:07:0b", "Basler", "acA645", "21000002", {}},
      {"192.168.7.10", "02:00:c0:a8:07:0a", "Basler", "acA645", "21000001", {}}};
  EXPECT_TRUE(check_addresses_differ(found)) << "a camera that answers on two interfaces is one camera";
  found.push_back({"192.168.7.11", "02:00:c0:a8:07:0c", "Basler", "acA645", "21000003", {}});
  const auto differ = check_addresses_differ(found);
  ASSERT_FALSE(differ);
  EXPECT_EQ(differ.error().code, ErrorCode::Unavailable);
  EXPECT_THAT(differ.error().message,
              AllOf(HasSubstr("192.168.7.11"), HasSubstr("21000002"), HasSubstr("21000003"),
                    HasSubstr("02:00:c0:a8:07:0b"), HasSubstr("02:00:c0:a8:07:0c")));
}

TEST(Discovery, ArrayWithAnAddressUsedTwiceIsRefusedBeforeAnythingIsSet) {
  SimulatedArrayOptions options = small_array(2);
  options.answers_broadcasts = true;
  options.reported_address = options.first_address;
  const auto simulated = SimulatedArray::open(options);
  if (!simulated)
    GTEST_SKIP() << "another array of this machine answers broadcasts: " << simulated.error().message;
  if (discover_all(std::chrono::milliseconds(500)).empty())
    GTEST_SKIP() << "broadcasts do not come back here";
  const auto serials = (*simulated)->serials();
  const auto array = CameraArray::open({{"cam00", "", serials[0]}, {"cam01", "", serials[1]}}, {});
  ASSERT_FALSE(array);
  EXPECT_THAT(array.error().message, AllOf(HasSubstr("two cameras use the address " + options.first_address),
                                           HasSubstr(serials[0]), HasSubstr(serials[1])));
}

TEST(Discovery, CamerasAreFoundBySerialNumber) {
  SimulatedArrayOptions options = small_array(3);
  options.answers_broadcasts = true;
  const auto simulated = SimulatedArray::open(options);
  if (!simulated)
    GTEST_SKIP() << "another array of this machine answers broadcasts: " << simulated.error().message;
  if (discover_all(std::chrono::milliseconds(500)).empty())
    GTEST_SKIP() << "broadcasts do not come back here";
  const auto found = resolve_addresses({{"left", "", (*simulated)->serials()[2]}, {"cam01"}});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_EQ((*found)[0].address, (*simulated)->addresses()[2]);
  EXPECT_EQ((*found)[1].address, (*simulated)->addresses()[1]) << "by its user-defined name";
  EXPECT_THAT(resolve_addresses({{"none", "", "12345"}}).error().message, HasSubstr("12345"));
}

}  // namespace
}  // namespace flamefield
