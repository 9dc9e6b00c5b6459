// The simulated camera used by programs that other people wrote.
#include <gmock/gmock.h>

#include <cstdio>
#include <cstdlib>

#include "tests/acquire/array_fixture.h"

namespace flamefield {
namespace {

using ::testing::HasSubstr;

std::string output_of(const std::string& command) {
  std::string out;
  FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  for (int c = 0; pipe && (c = std::fgetc(pipe)) != EOF;) out += static_cast<char>(c);
  if (pipe) ::pclose(pipe);
  return out;
}

bool is_installed(const std::string& program) {
  return std::system(("command -v " + program + " > /dev/null 2>&1").c_str()) == 0;
}

TEST(OtherClients, ArvToolReadsAndSetsACamera) {
  if (!is_installed("arv-tool-0.8"))
    GTEST_SKIP() << "arv-tool-0.8 (package aravis-tools-cli) is not installed";
  const auto simulated = SimulatedArray::open(small_array(1));
  ASSERT_TRUE(simulated) << simulated.error().message;
  const std::string tool = concat("timeout 20 arv-tool-0.8 -a ", (*simulated)->addresses()[0], " ");
  const std::string set = output_of(
      tool + "control GainRaw=12 ExposureTimeAbs=777 PixelFormat=Mono12 Width=32 TriggerSource=Action1");
  EXPECT_THAT(set, HasSubstr("GainRaw = 12"));
  EXPECT_THAT(set, HasSubstr("ExposureTimeAbs = 777"));
  EXPECT_THAT(set, HasSubstr("PixelFormat = Mono12"));
  EXPECT_THAT(set, HasSubstr("Width = 32"));
  EXPECT_THAT(set, HasSubstr("TriggerSource = Action1"));
  EXPECT_THAT(output_of(tool + "control DeviceSerialNumber SensorWidth"),
              testing::AllOf(HasSubstr((*simulated)->serials()[0]), HasSubstr("SensorWidth = 64")));
  const std::string features = output_of(tool + "features");
  for (const char* name :
       {"ChunkSelector", "GevSCFTD", "ActionGroupMask", "BinningVertical", "TestImageSelector"})
    EXPECT_THAT(features, HasSubstr(name));
}

TEST(OtherClients, ArvCameraTestStreamsFromACamera) {
  if (!is_installed("arv-camera-test-0.8"))
    GTEST_SKIP() << "arv-camera-test-0.8 is not installed (Debian 12 packages aravis without it)";
  const auto simulated = SimulatedArray::open(small_array(1));
  ASSERT_TRUE(simulated) << simulated.error().message;
  // It waits for frames of a camera that runs freely.
  const std::string out = output_of(concat("timeout 8 arv-camera-test-0.8 --name ",
                                           (*simulated)->addresses()[0], " --frequency 10 --duration 3"));
  EXPECT_THAT(out, HasSubstr("frames/s"));
}

}  // namespace
}  // namespace flamefield
