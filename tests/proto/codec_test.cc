#include "proto/codec.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace flamefield {
namespace {

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text));
}

FrameSet small_set() {
  FrameSet set;
  set.capture = "20260301T101500-burst";
  set.pulse = 12;
  set.index = 3;
  set.pulse_time_ns = 1'700'000'000'000'000'000;
  set.complete_time_ns = set.pulse_time_ns + 5'000'000;
  for (const char* name : {"cam00", "cam01"}) {
    Frame frame{name, 12, 77, 1'700'000'000'000'000'100, 900, 4, 3, PixelFormat::Mono12, nullptr};
    frame.bytes = std::make_shared<const std::vector<std::byte>>(24, std::byte{7});
    set.frames.push_back(frame);
  }
  set.losses.push_back({"cam02", LossCause::Incomplete});
  return set;
}

Rig small_rig() {
  Rig rig;
  for (const char* name : {"cam00", "cam01"}) {
    Camera camera;
    camera.name = name;
    camera.image_width_px = 4;
    camera.image_height_px = 3;
    camera.fx_px = camera.fy_px = 10.25;
    camera.distortion = {0.1, -0.2, 0.001, 0, 0};
    camera.camera_from_world.translation_mm = {0, 0, 300};
    rig.cameras.push_back(camera);
  }
  rig.quality = RigQuality{0.08, 20, {CameraQuality{20, 900, 4, 0.08, 0.5, 0.1, 1e-4}, CameraQuality{}}};
  return rig;
}

Processing some_processing() {
  Processing p;
  p.rig_id = fingerprint(small_rig());
  p.recipe.settings = {{"mlem.max_iterations", std::int64_t{80}},
                       {"mlem.tolerance", 1.0},
                       {"prepare.clip_negative", true},
                       {"note.text", std::string("80")}};
  p.grid = centred_grid(10, 12, 14, 0.5);
  p.dark_capture = "dark-1";
  return p;
}

Run some_run() {
  Run run;
  run.id = "burst-0003-0a1b2c3d";
  run.job_id = 9;
  run.inputs = {{"burst", 3}};
  run.processing = some_processing();
  run.volume_path = "volumes/burst-0003-0a1b2c3d.vtkhdf";
  run.residual = 0.125;
  run.residual_per_view = {{"cam00", 0.1}, {"cam01", 0.2}};
  run.metrics = {{"pearson_3d", 0.97}};
  run.provenance = {"binned by 2"};
  run.history = {{10, 0.5, 0.1, 0, {}}, {20, 0.25, 0.2, 0.75, {0.5f, 0.25f, 0, 0, 0.125f}}};
  run.timings = {1, 2, 3, 4, 5};
  run.host = "lab";
  run.threads = 2;
  run.estimated_s = 1.5;
  run.estimated_mib = 100;
  run.peak_rss_mib = 90;
  run.warm_start = "burst-0002-0a1b2c3d";
  run.volume_sha256 = "ab";
  run.projections_sha256 = "cd";
  run.projections_bytes = 6;
  run.seed = 5;
  return run;
}

Lease some_lease() {
  Lease lease{41, 5000, {}, small_rig()};
  lease.job.id = 9;
  lease.job.run_id = "burst-0003-0a1b2c3d";
  lease.job.inputs = {{"burst", 3}, {"burst", 4}};
  lease.job.dark = {{"dark-1", 0}};
  lease.job.processing = some_processing();
  lease.job.priority = Priority::Live;
  lease.job.attempt = 2;
  lease.job.submitter = "me";
  lease.job.submission = 5;
  lease.job.estimated_s = 1.5;
  lease.job.estimated_mib = 100;
  return lease;
}

CalibrationState some_calibration_state() {
  CalibrationState state;
  state.phase = CalibrationPhase::Solved;
  state.id = "20260301T101500-calibration";
  state.automatic = state.still = true;
  state.wanted_poses = 20;
  state.poses = 3;
  state.message = "pose002 taken";
  state.cameras = {{"cam00", true, "", {1.5, 2.5}, 3, 0.5, {true, false}, {1, 2, 3, 4}, 0.02, 1.5, true}};
  state.needed = {"tilt the board towards cam01"};
  state.links_missing = {{"cam00", "cam01"}};
  state.verdict = "green";
  state.moved = {"cam00"};
  state.report = "calibrations/a/report.html";
  return state;
}

Calibration some_calibration() {
  Calibration c;
  c.version = 3;
  c.predecessor = 2;
  c.accepted_by = "me";
  c.note = "why";
  c.capture = "20260301T101500-calibration";
  c.poses = 20;
  c.rms_px = 0.05;
  c.volume_mean_px = 0.01;
  c.volume_worst_px = 0.02;
  c.verdict = "green";
  c.moved = {"cam00"};
  return c;
}

Schedule some_schedule() {
  Schedule schedule;
  schedule.name = "nightly";
  schedule.cron = "0 2 * * *";
  schedule.zone = "Europe/Vienna";
  schedule.missed = MissedRuns::Skip;
  schedule.overlap = OverlapRuns::Queue;
  schedule.order = {"residual > 0.1",      true, "abc", "solver = \"mlem\"", {"mlem.max_iterations=9"},
                    {"mlem.tolerance=1,2"}};
  schedule.created_time_ns = 3;
  schedule.last_due_ns = 4;
  return schedule;
}

std::vector<Message> one_of_each() {
  Submit submit;
  submit.captures = {"burst"};
  submit.sets = {{"other", 4}};
  submit.combine = Combine::Mean;
  submit.processing = some_processing();
  submit.priority = Priority::Scheduled;
  submit.submitter = "night-shift";
  Status status;
  status.workers = {{"w1", 3, 0.5, "host", 2, 4, 8000}};
  status.queued_by_priority = {{"live", 3}};
  status.paused = true;
  status.waiting = {{7, "no worker"}};
  status.counters = {{"leases_expired", 2}};
  const Error error{ErrorCode::DataLoss, "x (y) z"};
  return {PutSet{small_set()},
          SetStored{{"burst", 3}, true},
          PutCapture{"burst",
                     CaptureKind::Dark,
                     1,
                     2,
                     30,
                     {"cam00"},
                     40,
                     5,
                     CaptureEnd::Stopped,
                     "on request",
                     {{"cam00", 31, 29, {{"missed", 1}}, {{"late", 2}}}},
                     {{"exposure_us", "350"}}},
          PutRig{small_rig()},
          RigStored{"abc"},
          LivePlan{true, some_processing()},
          submit,
          Submitted{{1, 2}, {"a", "b"}, 1},
          PutMetrics{"run", {{"a", 1.5}}},
          GetStatus{},
          status,
          Ready{"worker-1", "0.1.0", 2, "host", 4, 8000, "id", true, true},
          some_lease(),
          FetchSet{{"burst", 3}},
          SetData{small_set()},
          Heartbeat{{41, "run", "solve", 3, 80, 0.5, 1.5}},
          LeaseLost{41},
          Finish{41, some_run()},
          Committed{"run"},
          Fail{41, error, true},
          Accepted{},
          Rejected{error},
          Event{5, "set-stored", "burst", "text"},
          StartCapture{CaptureKind::Burst, 30, "burst", 5},
          StopCapture{},
          GetCapture{},
          GetPreview{"cam00"},
          CaptureState{CapturePhase::Draining,
                       "burst",
                       CaptureKind::Dark,
                       30,
                       7,
                       6,
                       {{"cam00", "127.0.0.2", true, 7, {{"missed", 1}}, 0.25, {{"late", 2}}}},
                       1,
                       2,
                       3,
                       "disk full"},
          ControlJobs{JobAction::Cancel, {3, 4}, 5, true},
          JobsControlled{2, 1},
          GetJobs{JobState::Failed, 5, 20},
          Jobs{{{3, "run", JobState::Failed, Priority::Scheduled, "me", 5, 2, "w1", 17, "out of memory"}}},
          StandBy{},
          StartCalibration{BoardSpec{9, 6, 12, BoardKind::Charuco, 8, "4X4_50"}, Eigen::Vector3d(1, 2, 3),
                           0.5, 12, true},
          TakePose{},
          SolveCalibration{},
          AcceptCalibration{"me", "why"},
          DiscardCalibration{},
          GetCalibration{},
          some_calibration_state(),
          PutCalibration{some_calibration(), small_rig()},
          CalibrationStored{3, "abc"},
          PutTags{"burst", {"good"}, {"bad"}},
          AcceptRig{"abc", 7},
          PutSchedule{some_schedule()},
          DropSchedule{"nightly"},
          ScheduleRan{"nightly", 5, 6, "submitted", "3 jobs", {1, 2, 3}},
          Retire{{"run-1", "run-2"}}};
}

TEST(Codec, EveryMessageSurvivesARoundTrip) {
  const std::vector<Message> messages = one_of_each();
  ASSERT_EQ(messages.size(), std::variant_size_v<Message>) << "a new message needs an example here";
  for (std::size_t i = 0; i < messages.size(); ++i) {
    ASSERT_EQ(messages[i].index(), i) << "keep the order of the variant";
    const std::string once = encode(messages[i], 17);
    const auto decoded = decode(bytes_of(once));
    ASSERT_TRUE(decoded) << i << ": " << decoded.error().message;
    EXPECT_EQ(decoded->request, 17u);
    EXPECT_EQ(decoded->message.index(), i);
    if (frame_set_of(decoded->message)) continue;  // its pixels travel beside it: next test
    EXPECT_EQ(encode(decoded->message, 17), once) << i;
  }
}

TEST(Codec, AFrameSetKeepsEveryFieldAndGetsItsPixelsBack) {
  const FrameSet set = small_set();
  auto decoded = decode(bytes_of(encode(PutSet{set})));
  ASSERT_TRUE(decoded);
  FrameSet* back = frame_set_of(decoded->message);
  ASSERT_NE(back, nullptr);
  EXPECT_EQ(back->frames[0].bytes, nullptr);
  ASSERT_TRUE(attach_frames(*back, {set.frames[0].bytes, set.frames[1].bytes}));
  EXPECT_EQ(encode(PutSet{*back}), encode(PutSet{set}));
  EXPECT_EQ(back->frames[1].bytes, set.frames[1].bytes);
}

TEST(Codec, RecipeSettingsKeepTheirTypes) {
  const auto decoded = decode(bytes_of(encode(LivePlan{true, some_processing()})));
  ASSERT_TRUE(decoded);
  EXPECT_EQ(std::get<LivePlan>(decoded->message).processing.recipe, some_processing().recipe);
}

TEST(Codec, PixelsOfTheWrongSizeOrNumberAreRefused) {
  FrameSet set = small_set();
  const Bytes good = set.frames[0].bytes;
  const Bytes cut = std::make_shared<const std::vector<std::byte>>(good->size() - 1);
  const Bytes longer = std::make_shared<const std::vector<std::byte>>(good->size() + 1);
  EXPECT_FALSE(attach_frames(set, {good}));
  EXPECT_FALSE(attach_frames(set, {good, cut}));
  EXPECT_FALSE(attach_frames(set, {good, longer}));
  EXPECT_FALSE(attach_frames(set, {good, nullptr}));
}

TEST(Codec, ValuesOutOfRangeAreRefused) {
  const auto refused = [](const Message& message) { return !decode(bytes_of(encode(message))); };
  FrameSet set = small_set();
  set.capture = "../etc";
  EXPECT_TRUE(refused(PutSet{set}));
  set = small_set();
  set.frames[0].width_px = 1'000'000;
  EXPECT_TRUE(refused(PutSet{set}));
  set = small_set();
  set.frames[0].height_px = 4;
  EXPECT_TRUE(refused(PutSet{set}));
  set = small_set();
  set.losses.resize(kMaxCameras, {"cam02", LossCause::Late});
  EXPECT_TRUE(refused(PutSet{set}));

  auto run = some_run();
  run.residual = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(refused(Finish{1, run}));
  for (const char* path : {"/etc/passwd", "volumes/../../x", "", "volumes//x", "volumes/"}) {
    run = some_run();
    run.volume_path = path;
    EXPECT_TRUE(refused(Finish{1, run})) << path;
  }
  Rig rig = small_rig();
  rig.cameras[1].camera_from_world.rotation *= 2;
  EXPECT_TRUE(refused(PutRig{rig}));
  LivePlan plan{true, some_processing()};
  plan.processing.grid.nx = 0;
  EXPECT_TRUE(refused(plan));
}

TEST(Codec, CutMessagesNeverCrashAndDecodeOnlyToValidValues) {
  for (const Message& message : one_of_each()) {
    const std::string whole = encode(message, 3);
    for (std::size_t n = 0; n < whole.size(); ++n) {
      const auto decoded = decode(bytes_of(whole.substr(0, n)));
      if (!decoded || frame_set_of(decoded->message)) continue;
      EXPECT_TRUE(decode(bytes_of(encode(decoded->message))));
    }
  }
}

TEST(Codec, FlippedBytesNeverCrash) {
  const unsigned seed = std::random_device()();
  SCOPED_TRACE(concat("seed ", seed));
  std::mt19937 random(seed);
  for (const Message& message : one_of_each()) {
    const std::string whole = encode(message, 3);
    for (int round = 0; round < 400; ++round) {
      std::string broken = whole;
      for (int flips = 0; flips < 1 + round % 4; ++flips)
        broken[random() % broken.size()] = static_cast<char>(random());
      (void)decode(bytes_of(broken));
    }
  }
}

// A sound message, followed by a field that a newer program may send: only its length can be held against it.
TEST(Codec, AHugeHeaderIsRefusedThoughItsFieldsAreSound) {
  const std::string message = encode(GetStatus{});
  const auto padded = [&](unsigned bytes) {
    std::string header = message + "\xc2\x3e";  // field 1000, of so many bytes:
    for (unsigned left = bytes; left > 0; left >>= 7)
      header += static_cast<char>((left & 127) | (left > 127 ? 128 : 0));
    return header.append(bytes, '\0');
  };
  EXPECT_TRUE(decode(bytes_of(padded(1000))));
  EXPECT_FALSE(decode(bytes_of(padded(kMaxHeaderBytes))));
}

TEST(Job, StagedPathKeepsTheExtension) {
  EXPECT_EQ(staged_path("volumes/a.b.vtkhdf", 7), "volumes/a.b.part-7.vtkhdf");
  EXPECT_EQ(staged_path("vol.umes/ab", 7), "vol.umes/ab.part-7");
}

TEST(Job, RunIdsDifferWheneverTheWorkDiffers) {
  Job job = some_lease().job;
  job.program_version = "0.1.0";
  const std::string id = run_id_of(job);
  EXPECT_TRUE(is_file_safe(id)) << id;
  EXPECT_EQ(run_id_of(job), id);
  Job other = job;
  other.inputs.pop_back();
  EXPECT_NE(run_id_of(other), id);
  other = job;
  other.processing.dark_capture = "dark-2";
  EXPECT_NE(run_id_of(other), id);
  other = job;
  other.processing.grid.origin_mm.x() += 1;
  EXPECT_NE(run_id_of(other), id);
  other = job;
  other.processing.recipe.settings["mlem.max_iterations"] = std::int64_t{81};
  EXPECT_NE(run_id_of(other), id);
  other = job;
  other.program_version = "0.2.0";
  EXPECT_NE(run_id_of(other), id);
}

}  // namespace
}  // namespace flamefield
