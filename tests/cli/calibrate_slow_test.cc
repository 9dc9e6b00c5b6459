#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <chrono>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "acquire/simulator/board_scene.h"
#include "acquire/simulator/true_rig.h"
#include "calibrate/quality.h"
#include "services/store/frame_file.h"
#include "services/store/rig_file.h"
#include "tests/cli/program.h"

namespace flamefield {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr const char* kBoard = " --board 9x6 --square-mm 12";

// Five small cameras 15 degrees apart look at a board that is shown to them in ten poses; the pictures
// are rendered once for all tests.
class CalibrationSession : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    scratch_ = new Scratch;
    TrueRigOptions ring;
    ring.cameras = 5;
    ring.spacing_rad = 0.2617993877991494;
    ring.image_width_px = 330;
    ring.image_height_px = 248;
    ring.focal_px = 606;
    truth_ = new Rig(ring_with_tolerances(ring));
    poses_ = new std::vector<Rigid3>(board_poses(
        {.count = 10, .last_azimuth_rad = 4 * ring.spacing_rad, .tilt_rad = 0.25, .offset_mm = 10}));
    for (const Camera& camera : truth_->cameras) {
      std::filesystem::create_directories(at("boards") / camera.name);
      for (std::size_t k = 0; k < poses_->size(); ++k)
        write_picture(at("boards") / camera.name / concat("pose", 100 + k, ".png"), camera, (*poses_)[k]);
    }
    solved_ = run(concat("calibrate solve boards", kBoard, " --out rig.yaml --report report --json"));
  }
  static void TearDownTestSuite() {
    delete scratch_;
    delete truth_;
    delete poses_;
  }
  void SetUp() override { ASSERT_EQ(solved_.exit_code, 0) << solved_.err; }

  static std::filesystem::path at(const std::string& name) { return *scratch_ / name; }
  static ProgramResult run(const std::string& arguments) { return flamefield(scratch_->path(), arguments); }

  static std::vector<std::uint8_t> picture(const Camera& camera, const Rigid3& pose) {
    const BoardScene scene{.light_gradient = 0.1, .defocus_sigma_px = 0.5};
    const Image image = render_board(camera, pose, scene);
    std::vector<std::uint8_t> levels;
    for (float electrons : image.pixels) {
      const double level = 255 * static_cast<double>(electrons) / scene.full_scale_electrons;
      levels.push_back(static_cast<std::uint8_t>(std::clamp(std::lround(level), 0l, 255l)));
    }
    return levels;
  }
  static void write_picture(const std::filesystem::path& path, const Camera& camera, const Rigid3& pose) {
    std::vector<std::uint8_t> levels = picture(camera, pose);
    cv::imwrite(path.string(), cv::Mat(camera.image_height_px, camera.image_width_px, CV_8U, levels.data()));
  }
  // One picture a camera of one pose: cam00.png ... in a folder of its own.
  static void write_one_pose(const std::string& folder, const Rig& rig) {
    std::filesystem::create_directories(at(folder));
    for (const Camera& camera : rig.cameras)
      write_picture(at(folder) / (camera.name + ".png"), camera, poses_->front());
  }

  static inline Scratch* scratch_ = nullptr;
  static inline Rig* truth_ = nullptr;
  static inline std::vector<Rigid3>* poses_ = nullptr;
  static inline ProgramResult solved_;
};

TEST_F(CalibrationSession, GivesTheTrueRigUpToTheReferenceFrame) {
  const auto rig = read_rig(at("rig.yaml"));
  ASSERT_TRUE(rig) << rig.error().message;
  const auto error = volume_error_px(*rig, *truth_, {.diameter_mm = 30, .height_mm = 40}, Alignment::Rigid);
  ASSERT_TRUE(error) << error.error().message;
  EXPECT_LT(error->worst_px, 0.3);
  EXPECT_LT(json_number(solved_.out, "rms_px"), 0.3);
  for (const char* key :
       {"\"pairs\"", "\"sigma\"", "\"unconnected\"", "\"volume_error_px\"", "\"split_half\""})
    EXPECT_THAT(solved_.out, HasSubstr(key));
}

TEST_F(CalibrationSession, IsReportedOnOnePageThatNeedsNothingElse) {
  EXPECT_EQ(*read_text_file(at("report/calibration.json")), solved_.out);
  const std::string page = *read_text_file(at("report/report.html"));
  for (const char* part : {"Calibration of the ring", "5 cameras, 10 board poses", "<svg", "cam04",
                           "What the calibration is worth", "Worst camera", "Off even spacing", "Pictures",
                           "Expected error in the measuring volume", "flamefield calibrate solve boards",
                           "fixed by pose pose100", "Pictures with the largest residuals"})
    EXPECT_THAT(page, HasSubstr(part));
  for (const char* part : {"src=\"http", "href=\"http", "<script"}) EXPECT_THAT(page, Not(HasSubstr(part)));
}

TEST_F(CalibrationSession, SearchesNoPictureTwiceWithACache) {
  const auto solve = [&] {
    const auto start = std::chrono::steady_clock::now();
    const ProgramResult result =
        run(concat("calibrate solve boards", kBoard, " --cache corners.json --out cached.yaml"));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  const double first_s = solve(), second_s = solve();
  std::printf("solve %.2f s, with all corners cached %.2f s\n", first_s, second_s);
  const auto cached = read_rig(at("cached.yaml")), rig = read_rig(at("rig.yaml"));
  ASSERT_TRUE(cached && rig);
  // Byte by byte: neither threads nor where memory lies show in the result.
  EXPECT_EQ(*read_text_file(at("cached.yaml")), *read_text_file(at("rig.yaml")));
  overwrite(at("corners.json"), "{ damaged");
  solve();
  EXPECT_THAT(*read_text_file(at("corners.json")), HasSubstr("flamefield-detections-1"));
}

TEST_F(CalibrationSession, NamesTheCameraThatHasMovedSinceAnEarlierCalibration) {
  Rig earlier = *read_rig(at("rig.yaml"));
  earlier.cameras[2].cx_px += 3;
  ASSERT_TRUE(write_rig(at("earlier.yaml"), earlier));
  const ProgramResult result =
      run(concat("calibrate solve boards", kBoard,
                 " --cache corners.json --out compared.yaml --compare earlier.yaml --report compared"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("cam02 has moved: 3.0"));
  EXPECT_THAT(*read_text_file(at("compared/report.html")), HasSubstr("Since earlier.yaml"));
}

TEST_F(CalibrationSession, ReadsSixteenBitAndColourPictures) {
  for (const Camera& camera : truth_->cameras) {
    std::filesystem::create_directories(at("deep") / camera.name);
    for (std::size_t k = 0; k < poses_->size(); ++k) {
      std::vector<std::uint8_t> levels = picture(camera, (*poses_)[k]);
      const cv::Mat grey(camera.image_height_px, camera.image_width_px, CV_8U, levels.data());
      cv::Mat deep, merged;
      grey.convertTo(deep, CV_16U, 200);
      cv::merge(std::vector<cv::Mat>{grey, grey, grey}, merged);
      const std::string path = (at("deep") / camera.name / concat("pose", 100 + k, ".png")).string();
      cv::imwrite(path, k % 2 == 0 ? deep : merged);
    }
  }
  const ProgramResult result = run(concat("calibrate solve deep", kBoard, " --out deep.yaml"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto deep = read_rig(at("deep.yaml")), rig = read_rig(at("rig.yaml"));
  ASSERT_TRUE(deep && rig);
  EXPECT_LT(volume_error_px(*deep, *rig, {})->worst_px, 0.02);
}

TEST_F(CalibrationSession, ReadsTheSameRigFromARecordedSession) {
  std::vector<FrameSet> sets(poses_->size());
  for (std::size_t k = 0; k < sets.size(); ++k) {
    sets[k].kind = CaptureKind::Board;
    sets[k].pulse = sets[k].index = static_cast<std::int64_t>(k);
    for (const Camera& camera : truth_->cameras) {
      const auto levels = picture(camera, (*poses_)[k]);
      const auto* bytes = reinterpret_cast<const std::byte*>(levels.data());
      Frame frame;
      frame.camera = camera.name;
      frame.pulse = sets[k].pulse;
      frame.width_px = camera.image_width_px;
      frame.height_px = camera.image_height_px;
      frame.bytes = std::make_shared<const std::vector<std::byte>>(bytes, bytes + levels.size());
      sets[k].frames.push_back(frame);
    }
  }
  ASSERT_TRUE(write_frames(at("session.nxs"), sets, {}));
  const ProgramResult result = run(concat("calibrate solve session.nxs", kBoard, " --out recorded.yaml"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto recorded = read_rig(at("recorded.yaml")), rig = read_rig(at("rig.yaml"));
  ASSERT_TRUE(recorded && rig);
  // Not to the last bit: the frames come in another order.
  const auto error = volume_error_px(*recorded, *rig, {});
  ASSERT_TRUE(error) << error.error().message;
  EXPECT_LT(error->worst_px, 1e-3);
}

TEST_F(CalibrationSession, ChecksARingThatStandsStillFromOnePictureACamera) {
  write_one_pose("today", *truth_);
  const ProgramResult result = run(concat("calibrate check --rig rig.yaml today/*.png --json", kBoard));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("\"moved\": []"));
  EXPECT_LT(json_number(result.out, "rms_px"), 0.3);
  EXPECT_EQ(run(concat("calibrate check --rig rig.yaml today", kBoard)).exit_code, 0);
}

TEST_F(CalibrationSession, NamesTheCameraThatWasPushedBySixTenthsOfADegree) {
  Rig pushed = *truth_;
  const Rigid3 turn{Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitX()).toRotationMatrix(),
                    Eigen::Vector3d::Zero()};
  pushed.cameras[3].camera_from_world = turn * pushed.cameras[3].camera_from_world;
  write_one_pose("pushed", pushed);
  const ProgramResult result = run(concat("calibrate check --rig rig.yaml pushed/*.png", kBoard));
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("moved: cam03 ("));
  EXPECT_THAT(result.out, HasSubstr("1 of 5 cameras"));
}

TEST_F(CalibrationSession, RefusesWhatItCannotUse) {
  const auto expect_refused = [&](const std::string& arguments, int exit_code, const std::string& part) {
    const ProgramResult result = run("calibrate " + arguments);
    EXPECT_EQ(result.exit_code, exit_code) << arguments;
    EXPECT_THAT(result.err, HasSubstr(part)) << arguments;
    EXPECT_FALSE(std::filesystem::exists(at("bad.yaml"))) << arguments;
  };
  expect_refused(concat("solve nowhere", kBoard, " --out bad.yaml"), 1, "nowhere");
  expect_refused("solve boards --board 2x9 --square-mm 12 --out bad.yaml", 2, "2x9");
  expect_refused("solve boards --board 11x8 --square-mm 12 --out bad.yaml", 1,
                 "looked for 11x8 inner corners, found 9x6");
  std::filesystem::create_directories(at("damaged/cam00"));
  overwrite(at("damaged/cam00/pose1.png"), "not a picture");
  expect_refused(concat("solve damaged", kBoard, " --out bad.yaml"), 1, "damaged/cam00/pose1.png");
  expect_refused("solve boards --board 9x6 --out bad.yaml", 2, "--square-mm");
  expect_refused(concat("solve boards", kBoard, " --out nowhere/bad.yaml"), 1, "nowhere/bad.yaml");
  expect_refused(concat("solve boards", kBoard, " --out bad.yaml --report rig.yaml/x"), 1, "rig.yaml/x");
  expect_refused(concat("solve boards --compare nowhere.yaml", kBoard, " --out bad.yaml"), 1, "nowhere.yaml");
  expect_refused(concat("solve boards --board-type charuco", kBoard, " --out bad.yaml"), 2,
                 "markers of 0 mm");
  expect_refused(
      concat("solve boards --board-type charuco --marker-mm 8 --dictionary 9X9_9", kBoard, " --out bad.yaml"),
      1, "9X9_9");
  expect_refused("check --rig rig.yaml", 2, "nothing to check with");
  expect_refused("check --rig rig.yaml --projections rig.yaml", 2, "--size");
  expect_refused(concat("check --rig nowhere.yaml boards", kBoard), 1, "nowhere.yaml");
  expect_refused(concat("check --rig rig.yaml boards/cam00/pose100.png boards/cam01/pose100.png", kBoard), 1,
                 "fewer than three");
}

}  // namespace
}  // namespace flamefield
