#include <gtest/gtest.h>

#include <algorithm>

#include "services/store/frame_file.h"
#include "services/store/npy.h"
#include "services/store/projection_file.h"
#include "services/store/rig_file.h"
#include "services/store/volume_file.h"
#include "tests/cli/program.h"

namespace flamefield {
namespace {

// A small torus with its rig and projections, made once for all tests.
class DeskChain : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    scratch_ = new Scratch;
    setup_ =
        shell(scratch_->path(),
              "\"$F\" phantom torus --size 60,60,60 --spacing-mm 0.5 --out truth.vtkhdf && "
              "\"$F\" ring --views 8 --spacing-deg 22.5 --radius-mm 300 --volume truth.vtkhdf --image 20,20 "
              "--out rig.yaml && "
              "\"$F\" render --volume truth.vtkhdf --rig rig.yaml --pixel-samples 3 --out projections.nxs");
  }
  static void TearDownTestSuite() {
    delete scratch_;
    scratch_ = nullptr;
  }
  void SetUp() override { ASSERT_EQ(setup_.exit_code, 0) << setup_.err; }

  static std::filesystem::path at(const std::string& name) { return *scratch_ / name; }
  static ProgramResult run(const std::string& arguments) { return flamefield(scratch_->path(), arguments); }
  // Asserts exit code, file in the message, and that neither `out` nor a temporary file stays.
  static void expect_refused(const std::string& arguments, int exit_code,
                             const std::vector<std::string>& parts, const std::string& out = "bad.vtkhdf") {
    const std::size_t before = scratch_->entries();
    const ProgramResult result = run(arguments);
    EXPECT_EQ(result.exit_code, exit_code) << arguments << "\n" << result.err;
    for (const std::string& part : parts)
      EXPECT_TRUE(contains(result.err, part)) << part << " in: " << result.err;
    EXPECT_FALSE(std::filesystem::exists(at(out))) << arguments;
    EXPECT_EQ(scratch_->entries(), before) << arguments;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_TRUE(result.out.empty()) << result.out;
  }

  static inline Scratch* scratch_ = nullptr;
  static inline ProgramResult setup_;
};

const std::string kReconstruct =
    "reconstruct --projections projections.nxs --rig rig.yaml --size 20,20,20 "
    "--spacing-mm 1.5 ";

TEST_F(DeskChain, KnowsTheSetUpsOfTheArticle) {
  const ProgramResult made =
      shell(scratch_->path(),
            "\"$F\" phantom hollow-sphere --out small.vtkhdf && \"$F\" phantom hollow-sphere "
            "--finer 2 --out fine.vtkhdf && \"$F\" ring --like hollow-sphere --volume "
            "fine.vtkhdf --out like.yaml");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const Volume small = *read_volume(at("small.vtkhdf")), fine = *read_volume(at("fine.vtkhdf"));
  EXPECT_EQ(small.grid, centred_grid(40, 40, 40, 1));
  EXPECT_EQ(fine.grid.nx, 80);
  EXPECT_TRUE(fine.grid.lower_mm().isApprox(small.grid.lower_mm()));
  const Rig rig = *read_rig(at("like.yaml"));
  EXPECT_EQ(rig.cameras.size(), 10u);
  EXPECT_EQ(rig.cameras.front().image_width_px, 40);
  expect_refused("ring --volume small.vtkhdf --out bad.yaml", 2, {"--views", "--like"}, "bad.yaml");
  expect_refused("ring --like taurus --volume small.vtkhdf --out bad.yaml", 2, {"did you mean 'torus'?"},
                 "bad.yaml");
}

TEST_F(DeskChain, RecoversATorusFromItsPictures) {
  const ProgramResult made =
      run(kReconstruct + "--solver mlem --set mlem.max_iterations=40 --out volume.vtkhdf --json");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_EQ(json_number(made.out, "iterations"), 40);
  EXPECT_LT(json_number(made.out, "residual"), 0.1);
  for (const char* key : {"wall_s", "voxel_updates", "peak_rss_mib"})
    EXPECT_GT(json_number(made.out, key), 0) << key;
  for (const char* key : {"\"solver\"", "\"projector_engine\"", "\"stop_reason\"", "\"history\""})
    EXPECT_TRUE(contains(made.out, key)) << key;

  const ProgramResult judged =
      run("evaluate --truth truth.vtkhdf --volume volume.vtkhdf --rig rig.yaml --projections projections.nxs "
          "--json");
  ASSERT_EQ(judged.exit_code, 0) << judged.err;
  EXPECT_GT(json_number(judged.out, "pearson_3d"), 0.9);
  EXPECT_LT(json_number(judged.out, "sqmd_3d"), 0.2);
  EXPECT_LT(json_number(judged.out, "sqmd_2d_mean"), 0.02);
  for (const char* key : {"rmse", "psnr_db", "ssim"}) EXPECT_GT(json_number(judged.out, key), 0) << key;
  for (const char* key : {"\"slices\"", "\"residual_per_view\""})
    EXPECT_TRUE(contains(judged.out, key)) << key;
  EXPECT_TRUE(judged.err.empty()) << judged.err;

  const ProgramResult drawn =
      run("evaluate --truth truth.vtkhdf --volume volume.vtkhdf --pictures pictures --json");
  ASSERT_EQ(drawn.exit_code, 0) << drawn.err;
  for (const char* name : {"truth", "volume", "slices", "correlation_hab", "scatter"})
    EXPECT_TRUE(std::filesystem::exists(at(concat("pictures/", name, ".png")))) << name;
  std::filesystem::remove_all(at("pictures"));
  std::filesystem::remove(at("volume.vtkhdf"));
}

TEST_F(DeskChain, GivesTheSameBytesAgainWhateverTheThreads) {
  ASSERT_EQ(
      run(kReconstruct + "--solver mlem --set mlem.max_iterations=5 --threads 1 --out a.vtkhdf").exit_code,
      0);
  ASSERT_EQ(
      run(kReconstruct + "--solver mlem --set mlem.max_iterations=5 --threads 3 --out b.vtkhdf").exit_code,
      0);
  EXPECT_EQ(*read_text_file(at("a.vtkhdf")), *read_text_file(at("b.vtkhdf")));
  std::filesystem::remove(at("a.vtkhdf"));
  std::filesystem::remove(at("b.vtkhdf"));
}

TEST_F(DeskChain, TakesProjectionsAsAnNpyInTheRigsOrder) {
  ASSERT_EQ(run("convert projections.nxs p.npy").exit_code, 0);
  ASSERT_EQ(run("convert truth.vtkhdf truth.npy").exit_code, 0);
  ASSERT_EQ(run("reconstruct --projections p.npy --rig rig.yaml --size 20,20,20 --spacing-mm 1.5 --out v.npy")
                .exit_code,
            0);
  // The truth came back without coordinates, so both need their spacing said; evaluate has one for both.
  const ProgramResult judged = run("evaluate --truth truth.vtkhdf --volume v.npy --spacing-mm 1.5 --json");
  ASSERT_EQ(judged.exit_code, 0) << judged.err;
  EXPECT_GT(json_number(judged.out, "pearson_3d"), 0.9);
  for (const char* name : {"p.npy", "truth.npy", "v.npy"}) std::filesystem::remove(at(name));
}

TEST_F(DeskChain, KeepsRecipeAndOriginInTheVolume) {
  overwrite(at("r.toml"), "solver = \"sirt\"\n[sirt]\nmax_iterations = 3\n");
  ASSERT_EQ(run(kReconstruct + "--recipe r.toml --origin-mm -14,-10,-14.25 --out v.vtkhdf").exit_code, 0);
  const auto record = read_volume_record(at("v.vtkhdf"));
  ASSERT_TRUE(record) << record.error().message;
  EXPECT_EQ(record->volume.grid.origin_mm, Eigen::Vector3d(-14, -10, -14.25));
  EXPECT_EQ(record->provenance.at("solver"), "sirt");
  EXPECT_TRUE(contains(record->provenance.at("recipe"), "max_iterations = 3"));
  EXPECT_EQ(record->provenance.at("iterations"), "3");
  for (const char* name : {"r.toml", "v.vtkhdf"}) std::filesystem::remove(at(name));
}

TEST_F(DeskChain, RefusesFilesThatAreCutShort) {
  const auto cut = [&](const std::string& name, const std::string& as) {
    const std::string bytes = *read_text_file(at(name));
    overwrite(at(as), bytes.substr(0, bytes.size() * 2 / 3));
  };
  ASSERT_EQ(run("convert projections.nxs whole.npy").exit_code, 0);
  cut("truth.vtkhdf", "cut.vtkhdf");
  cut("projections.nxs", "cut.nxs");
  cut("whole.npy", "cut.npy");
  cut("rig.yaml", "cut.yaml");
  const std::string grid = " --size 20,20,20 --spacing-mm 1.5 --out bad.vtkhdf";
  expect_refused("reconstruct --projections cut.nxs --rig rig.yaml" + grid, 1, {"cut.nxs"});
  expect_refused("reconstruct --projections cut.npy --rig rig.yaml" + grid, 1, {"cut.npy", "cut short"});
  expect_refused("reconstruct --projections projections.nxs --rig cut.yaml" + grid, 1, {"cut.yaml"});
  expect_refused("render --volume cut.vtkhdf --rig rig.yaml --out bad.nxs", 1, {"cut.vtkhdf"}, "bad.nxs");
  expect_refused("evaluate --truth truth.vtkhdf --volume cut.vtkhdf", 1, {"cut.vtkhdf"});
  for (const char* name : {"cut.vtkhdf", "cut.nxs", "cut.npy", "cut.yaml", "whole.npy"})
    std::filesystem::remove(at(name));
}

TEST_F(DeskChain, RefusesArraysOfTheWrongShape) {
  ASSERT_TRUE(write_npy(at("flat.npy"), {8, 400}, std::vector<float>(3200)));
  ASSERT_TRUE(write_npy(at("seven.npy"), {7, 20, 20}, std::vector<float>(2800)));
  ASSERT_TRUE(write_npy(at("wide.npy"), {8, 20, 21}, std::vector<float>(3360)));
  const auto with = [](const std::string& name) {
    return "reconstruct --projections " + name +
           " --rig rig.yaml --size 20,20,20 --spacing-mm 1.5 --out bad.vtkhdf";
  };
  expect_refused(with("flat.npy"), 1, {"flat.npy", "(views, rows, cols)"});
  expect_refused(with("seven.npy"), 1, {"seven.npy", "7 views", "8 cameras"});
  expect_refused(with("wide.npy"), 1, {"wide.npy", "21"});
  expect_refused("evaluate --truth flat.npy --volume truth.vtkhdf", 1, {"flat.npy", "(NZ, NY, NX)"});
  for (const char* name : {"flat.npy", "seven.npy", "wide.npy"}) std::filesystem::remove(at(name));
}

TEST_F(DeskChain, RefusesNanInProjectionsAndSaysWhere) {
  auto projections = *read_projections(at("projections.nxs"));
  projections.view(3)[4 * 20 + 5] = NAN;
  ASSERT_TRUE(write_projections(at("nan.nxs"), projections, {}));
  expect_refused(
      "reconstruct --projections nan.nxs --rig rig.yaml --size 20,20,20 --spacing-mm 1.5 --out bad.vtkhdf", 1,
      {"nan.nxs", "cam03", "4", "5"});
  std::filesystem::remove(at("nan.nxs"));
}

TEST_F(DeskChain, RefusesAMistakeInTheRecipeAndNamesTheLine) {
  overwrite(at("typo.toml"), "solver = \"mlem\"\n\n[mlem]\nmax_iteratons = 3\n");
  expect_refused(kReconstruct + "--recipe typo.toml --out bad.vtkhdf", 2, {"typo.toml:4", "max_iteratons"});
  overwrite(at("typo.toml"), "solver = \"mlme\"\n");
  expect_refused(kReconstruct + "--recipe typo.toml --out bad.vtkhdf", 2, {"typo.toml:1", "mlme", "mlem"});
  overwrite(at("typo.toml"), "solver = \"mlem\n");
  expect_refused(kReconstruct + "--recipe typo.toml --out bad.vtkhdf", 2, {"typo.toml:1"});
  std::filesystem::remove(at("typo.toml"));
  expect_refused(kReconstruct + "--recipe typo.toml --out bad.vtkhdf", 2, {"typo.toml", "no such file"});
  expect_refused(kReconstruct + "--solver mlme --out bad.vtkhdf", 2, {"mlme", "mlem"});
  expect_refused(kReconstruct + "--set mlem.max_iteratons=3 --out bad.vtkhdf", 2, {"max_iteratons"});
  expect_refused(kReconstruct + "--set nonsense --out bad.vtkhdf", 2, {"nonsense", "TABLE.KEY=VALUE"});
}

TEST_F(DeskChain, RefusesARigThatLacksACamera) {
  Rig rig = *read_rig(at("rig.yaml"));
  rig.cameras.erase(rig.cameras.begin() + 2);
  ASSERT_TRUE(write_rig(at("seven.yaml"), rig));
  expect_refused(
      "reconstruct --projections projections.nxs --rig seven.yaml --size 20,20,20 --spacing-mm 1.5 --out "
      "bad.vtkhdf",
      1, {"seven.yaml", "cam02"});
  std::filesystem::remove(at("seven.yaml"));
}

TEST_F(DeskChain, RefusesAnOutputThatCannotBeWrittenBeforeItStartsToWork) {
  expect_refused(kReconstruct + "--out nowhere/v.vtkhdf", 1, {"nowhere/v.vtkhdf", "No such file"}, "nowhere");
  expect_refused(kReconstruct + "--out rig.yaml/v.vtkhdf", 1, {"rig.yaml/v.vtkhdf"}, "bad");
  expect_refused(kReconstruct + "--out volume.stl", 2, {"volume.stl", ".vtkhdf"}, "volume.stl");
  expect_refused("phantom torus --size 8,8,8 --out /dev/null/x.npy", 1, {"/dev/null/x.npy"});
  expect_refused("phantom torus --size 8,8,8 --out .", 2, {"'.'"}, "bad");
}

TEST_F(DeskChain, AFullDiskLeavesNothingBehind) {
  const std::size_t before = scratch_->entries();
  const ProgramResult result =
      shell(scratch_->path(), "ulimit -f 64; \"$F\" phantom torus --size 60,60,60 --out big.vtkhdf");
  EXPECT_EQ(result.exit_code, 1) << result.err;
  EXPECT_TRUE(contains(result.err, "big.vtkhdf")) << result.err;
  EXPECT_EQ(scratch_->entries(), before);
}

TEST_F(DeskChain, KeepsTheBestSoFarOnCtrlCAndMarksIt) {
  // The program is asked to stop as soon as it reports progress of an endless solve.
  const ProgramResult result =
      shell(scratch_->path(), "timeout -s INT -k 20 1 \"$F\" " + kReconstruct +
                                  "--solver mlem --set mlem.max_iterations=1000000 --out endless.vtkhdf");
  EXPECT_TRUE(contains(result.err, "stopped")) << result.err;
  EXPECT_TRUE(contains(result.err, "endless.vtkhdf")) << result.err;
  const auto record = read_volume_record(at("endless.vtkhdf"));
  ASSERT_TRUE(record) << record.error().message;
  EXPECT_EQ(record->provenance.at("stop_reason"), "cancelled");
  EXPECT_GT(*std::ranges::max_element(record->volume.values), 0);
  std::filesystem::remove(at("endless.vtkhdf"));
}

TEST_F(DeskChain, StartsFromAnEarlierVolumeOfTheSameGridOnly) {
  const std::string few = kReconstruct + "--solver sirt --set sirt.max_iterations=";
  ASSERT_EQ(run(few + "60 --out first.vtkhdf").exit_code, 0);
  const ProgramResult cold = run(few + "1 --out cold.vtkhdf --json"),
                      warm = run(few + "1 --start first.vtkhdf --out warm.vtkhdf --json");
  ASSERT_EQ(warm.exit_code, 0) << warm.err;
  EXPECT_LT(json_number(warm.out, "residual"), 0.5 * json_number(cold.out, "residual"));
  EXPECT_EQ(read_volume_record(at("warm.vtkhdf"))->provenance.at("start"), "first.vtkhdf");
  expect_refused(
      "reconstruct --projections projections.nxs --rig rig.yaml --size 20,20,20 --spacing-mm 1.4 --solver "
      "sirt "
      "--start first.vtkhdf --out bad.vtkhdf",
      1, {"warm start", "same size"});
  for (const char* name : {"first.vtkhdf", "cold.vtkhdf", "warm.vtkhdf"}) std::filesystem::remove(at(name));
}

TEST_F(DeskChain, WritesTheSigmaOfMapBesideTheField) {
  ASSERT_EQ(run(kReconstruct + "--solver map --set map.draws=4 --set map.max_iterations=20 --out m.vtkhdf")
                .exit_code,
            0);
  const auto record = read_volume_record(at("m.vtkhdf"));
  ASSERT_TRUE(record) << record.error().message;
  ASSERT_EQ(record->sigma.size(), record->volume.values.size());
  EXPECT_GT(*std::ranges::max_element(record->sigma), 0);
  EXPECT_TRUE(contains(record->provenance.at("note_1"), "weight"));
  std::filesystem::remove(at("m.vtkhdf"));
}

TEST_F(DeskChain, KeepsTheBestSoFarWhenTimeRunsOut) {
  const ProgramResult result =
      run(kReconstruct +
          "--solver mlem --set mlem.max_iterations=1000000 --time-limit-s 0.3 --out limited.vtkhdf --json");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_GT(json_number(result.out, "iterations"), 0);
  EXPECT_TRUE(std::filesystem::exists(at("limited.vtkhdf")));
  std::filesystem::remove(at("limited.vtkhdf"));
}

TEST_F(DeskChain, ConvertsForOtherPrograms) {
  for (const char* name : {"c.vti", "c.tif", "c.npy"}) {
    ASSERT_EQ(run(std::string("convert truth.vtkhdf ") + name).exit_code, 0) << name;
    const auto volume = read_volume(at(name));
    ASSERT_TRUE(volume) << volume.error().message;
    EXPECT_EQ(volume->values, read_volume(at("truth.vtkhdf"))->values) << name;
    std::filesystem::remove(at(name));
  }
  EXPECT_EQ(run("convert rig.yaml colmap/").exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(at("colmap/cameras.txt")));
  EXPECT_EQ(run("convert rig.yaml kalibr").exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(at("kalibr/camchain.yaml")));
  EXPECT_EQ(run("convert rig.yaml colmap/ring.cameramodel").exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(at("colmap/ring-cam07.cameramodel")));
  std::filesystem::remove_all(at("colmap"));
  std::filesystem::remove_all(at("kalibr"));
}

TEST_F(DeskChain, ShowsAVolumeAsAPicture) {
  const ProgramResult result = run("show truth.vtkhdf --out picture.png");
  if (contains(result.err, "gnuplot")) GTEST_SKIP() << result.err;
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(read_text_file(at("picture.png"))->substr(1, 3), "PNG");
  std::filesystem::remove(at("picture.png"));
}

// Frames whose grey levels are the projections themselves, recorded with dark frames of another level.
TEST_F(DeskChain, PreparesRecordedFrames) {
  const auto projections = *read_projections(at("projections.nxs"));
  const float brightest = *std::max_element(projections.values.begin(), projections.values.end());
  std::vector<FrameSet> sets(4);
  for (std::size_t s = 0; s < sets.size(); ++s) {
    sets[s].kind = s < 2 ? CaptureKind::Dark : CaptureKind::Burst;
    sets[s].pulse = static_cast<std::int64_t>(s);
    for (std::size_t v = 0; v < projections.views(); ++v) {
      auto bytes = std::make_shared<std::vector<std::byte>>();
      for (float p : projections.view(v))
        bytes->push_back(static_cast<std::byte>(s < 2 ? 10 : 10 + std::lround(200 * p / brightest)));
      sets[s].frames.push_back({projections.view_names[v], sets[s].pulse, 0, 0, 100, projections.cols,
                                projections.rows, PixelFormat::Mono8, bytes});
    }
  }
  ASSERT_TRUE(write_frames(at("frames.nxs"), sets, {}));
  overwrite(at("prepare.toml"), "[prepare]\nlevel = false\nbinning = 1\nmargin_px = 0.0\n");
  const ProgramResult result =
      run("prepare frames.nxs --rig rig.yaml --recipe prepare.toml --size 20,20,20 --spacing-mm 1.5 --out "
          "prepared.nxs "
          "--rig-out cropped.yaml");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto prepared = read_projections(at("prepared.nxs"));
  ASSERT_TRUE(prepared) << prepared.error().message;
  EXPECT_EQ(prepared->view_names, projections.view_names);
  EXPECT_TRUE(read_rig(at("cropped.yaml")));
  EXPECT_NEAR(*std::max_element(prepared->values.begin(), prepared->values.end()), 200, 1);

  // By default the cameras come out level, all of one size, and there are pictures to look at.
  const ProgramResult level =
      run("prepare frames.nxs --rig rig.yaml --size 20,20,20 --spacing-mm 1.5 --out prepared.nxs --rig-out "
          "cropped.yaml --pictures pictures");
  ASSERT_EQ(level.exit_code, 0) << level.err;
  EXPECT_TRUE(contains(level.out, "level cameras")) << level.out;
  EXPECT_TRUE(contains(level.out, "saturated pixels: none")) << level.out;
  const auto cameras = read_rig(at("cropped.yaml"));
  ASSERT_TRUE(cameras);
  for (const Camera& c : cameras->cameras) EXPECT_NEAR(c.camera_from_world.rotation(1, 1), -1, 1e-9);
  EXPECT_TRUE(std::filesystem::exists(at("pictures/overview.png")));
  EXPECT_TRUE(std::filesystem::exists(at("pictures/cam07.png")));
  std::filesystem::remove_all(at("pictures"));
  for (const char* name : {"frames.nxs", "prepare.toml", "prepared.nxs", "cropped.yaml"})
    std::filesystem::remove(at(name));
}

}  // namespace
}  // namespace flamefield
