// The main job at small size, as a user runs it: real frames over UDP, real queue, real ledger, real files.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "services/ledger/reader.h"
#include "services/store/rig_file.h"
#include "tests/e2e/installation.h"
#include "tests/support/slowdown.h"

namespace flamefield {
namespace {

class Demo : public testing::Test {
 protected:
  ProgramResult demo(const std::string& more = {}) const {
    return run_flamefield(scratch_.path(), concat("demo --out out --pulses 4 --poses 12 --port 0 --rate-hz ",
                                                  5.0 / testing_support::kSlowdown, " --first-address ",
                                                  unused_loopback_address(), " ", more));
  }
  nlohmann::json summary() const {
    return nlohmann::json::parse(*read_text_file(scratch_ / "out/summary.json"));
  }

  Scratch scratch_;
};

TEST_F(Demo, GoesFromTheBurnerToTheVolume) {
  const ProgramResult result = demo();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto found = summary();
  EXPECT_EQ(found["pulses"], 4);
  EXPECT_EQ(found["sets"], 4);
  EXPECT_EQ(found["volumes"], 4);
  EXPECT_LE(found["volume_error_px"]["worst"].get<double>(), 0.10);
  EXPECT_LE(found["calibration_rms_px"].get<double>(), 0.10);
  EXPECT_GE(found["pearson_mean"].get<double>(), 0.93);
  EXPECT_LE(found["sqmd_mean"].get<double>(), 0.10);

  // The ledger says the same, and the rig in use is the estimated one.
  auto reader = LedgerReader::open(scratch_ / "out/data");
  ASSERT_TRUE(reader) << reader.error().message;
  const auto runs = reader->runs();
  ASSERT_TRUE(runs);
  ASSERT_EQ(runs->size(), 5u);  // every pulse, and the mean
  const Rig estimated = *read_rig(scratch_ / "out/rig.yaml"),
            truth = *read_rig(scratch_ / "out/true-rig.yaml");
  EXPECT_EQ(runs->front().run.processing.rig_id, fingerprint(estimated));
  EXPECT_NE(fingerprint(estimated), fingerprint(truth));
  for (const RunRow& row : *runs) {
    EXPECT_TRUE(std::filesystem::exists(scratch_ / "out/data" / row.run.volume_path));
    EXPECT_GT(row.run.metrics.at("pearson_3d"), 0.93);
  }
  const auto receipt = reader->receipt(runs->front().run.inputs.front().capture);
  ASSERT_TRUE(receipt);
  EXPECT_TRUE(receipt->balances());
  EXPECT_EQ(receipt->cameras.size(), 15u);

  const std::string report = *read_text_file(scratch_ / "out/report.html");
  for (const char* part : {"Pearson", "SqMD", "HAB", "cam14", "pulse"})
    EXPECT_NE(report.find(part), std::string::npos);
}

TEST_F(Demo, ShowsAnyOtherFieldInTheArray) {
  const ProgramResult result =
      demo("--cameras 15 --flame '" FLAMEFIELD_TEST_DATA "/vflame_small.npy' --spacing-mm 1");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(summary()["volumes"], 4);
  EXPECT_GE(summary()["pearson_mean"].get<double>(), 0.90);
}

TEST_F(Demo, RefusesAFieldThatIsCutShort) {
  const std::string whole = *read_text_file(FLAMEFIELD_TEST_DATA "/vflame_small.npy");
  overwrite(scratch_ / "cut.npy", whole.substr(0, whole.size() / 2));
  const ProgramResult result = demo("--flame cut.npy --spacing-mm 1");
  EXPECT_NE(result.exit_code, 0);
  EXPECT_NE(result.err.find("cut.npy"), std::string::npos) << result.err;
  EXPECT_FALSE(std::filesystem::exists(scratch_ / "out/summary.json"));
}

}  // namespace
}  // namespace flamefield
