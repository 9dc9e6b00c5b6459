#include "services/doctor/doctor.h"

#include <gmock/gmock.h>

#include "tests/support/scratch.h"

namespace flamefield {
namespace {

using ::testing::HasSubstr;

// A machine made of files.
class Machine {
 public:
  Machine& put(const std::string& file, const std::string& text) {
    std::filesystem::create_directories((scratch_ / file).parent_path());
    overwrite(scratch_ / file, text + "\n");
    return *this;
  }
  const std::filesystem::path& root() const { return scratch_.path(); }

 private:
  Scratch scratch_;
};

TEST(Doctor, SmallSocketBuffersAreBadAndTheFixIsACommand) {
  Machine machine;
  machine.put("proc/sys/net/core/rmem_max", "212992");
  const Finding finding = check_socket_buffers(machine.root(), {});
  EXPECT_EQ(finding.health, Health::Bad);
  EXPECT_THAT(finding.fix, HasSubstr("sysctl -w net.core.rmem_max=8388608"));
  machine.put("proc/sys/net/core/rmem_max", "33554432");
  EXPECT_EQ(check_socket_buffers(machine.root(), {}).health, Health::Good);
}

TEST(Doctor, PacketsLargerThanAnInterfaceCarriesAreBad) {
  Machine machine;
  machine.put("sys/class/net/eth0/mtu", "1500").put("sys/class/net/eth0/operstate", "up");
  machine.put("sys/class/net/eth0/speed", "1000");
  EXPECT_EQ(check_interfaces(machine.root(), 1500).at(0).health, Health::Good);
  const Finding finding = check_interfaces(machine.root(), 9000).at(0);
  EXPECT_EQ(finding.health, Health::Bad);
  EXPECT_THAT(finding.fix, HasSubstr("ip link set eth0 mtu 9000"));
  machine.put("sys/class/net/eth0/speed", "100");
  EXPECT_EQ(check_interfaces(machine.root(), 1500).at(0).health, Health::Bad);
}

TEST(Doctor, StrictReversePathFilterIsDoubtful) {
  Machine machine;
  machine.put("sys/class/net/eth0/mtu", "1500").put("proc/sys/net/ipv4/conf/all/rp_filter", "0");
  machine.put("proc/sys/net/ipv4/conf/eth0/rp_filter", "1");
  EXPECT_THAT(check_reverse_path_filter(machine.root()).at(0).fix,
              HasSubstr("net.ipv4.conf.eth0.rp_filter=2"));
  machine.put("proc/sys/net/ipv4/conf/all/rp_filter", "2");
  EXPECT_EQ(check_reverse_path_filter(machine.root()).at(0).health, Health::Good) << "the larger one counts";
}

TEST(Doctor, PowersaveGovernorIsDoubtful) {
  Machine machine;
  machine.put("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave");
  EXPECT_EQ(check_governor(machine.root()).health, Health::Doubtful);
  machine.put("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance");
  EXPECT_EQ(check_governor(machine.root()).health, Health::Good);
}

TEST(Doctor, DiskThatFillsInMinutesIsBad) {
  const Scratch scratch;
  EXPECT_EQ(check_disk(scratch.path(), 1e15, false).at(0).health, Health::Bad);
  EXPECT_EQ(check_disk(scratch.path(), 1, false).at(0).health, Health::Good);
  EXPECT_EQ(check_disk(scratch / "not-made-yet", 1, true).size(), 2u);
}

TEST(Doctor, CameraThatDoesNotAnswerIsNamedWithItsAddress) {
  const auto findings = check_cameras({{"cam07", "127.255.254.7"}});
  ASSERT_FALSE(findings.empty());
  EXPECT_EQ(findings[0].health, Health::Bad);
  EXPECT_THAT(findings[0].subject, HasSubstr("cam07"));
  EXPECT_THAT(findings[0].found, HasSubstr("127.255.254.7"));
}

TEST(Doctor, RateThatDoesNotFitIsBad) {
  EXPECT_EQ(check_bandwidth({.rate_hz = 100}).health, Health::Bad);
  EXPECT_EQ(check_bandwidth({.rate_hz = 5}).health, Health::Good);
}

}  // namespace
}  // namespace flamefield
