#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "services/api/frame_messages.h"
#include "services/api/lab_state.h"
#include "services/api/pages.h"
#include "services/api/recipe_json.h"
#include "services/api/volume_messages.h"
#include "services/bus/bus.h"
#include "services/gateway/web_files.h"
#include "tests/services/small_lab.h"
#include "tests/support/scratch.h"

namespace flamefield {
namespace {

using nlohmann::json;

// A binary message, taken apart as services/gateway/notice_board.h describes it.
struct Parts {
  json head;
  std::string payload;
  explicit Parts(const std::string& message) {
    EXPECT_EQ(message.substr(0, 4), "FFW1");
    std::uint32_t length = 0;
    std::memcpy(&length, message.data() + 4, 4);
    EXPECT_EQ((8 + length) % 8, 0u) << "the payload must be aligned";
    head = json::parse(message.substr(8, length));
    payload = message.substr(8 + length);
  }
  unsigned at(std::size_t i) const { return static_cast<unsigned char>(payload.at(i)); }
};

Frame frame_of(PixelFormat format, int width, int height, const std::function<int(int, int)>& level) {
  Frame frame;
  frame.camera = "cam00";
  frame.width_px = width;
  frame.height_px = height;
  frame.format = format;
  std::vector<std::byte> bytes;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      bytes.push_back(static_cast<std::byte>(level(x, y) & 0xff));
      if (format != PixelFormat::Mono8) bytes.push_back(static_cast<std::byte>(level(x, y) >> 8));
    }
  }
  frame.bytes = std::make_shared<const std::vector<std::byte>>(std::move(bytes));
  return frame;
}

TEST(Thumbnails, AreMeansOfWholeBlocksOfPixels) {
  const auto level = [](int x, int y) { return (7 * x + 13 * y) % 256; };
  FrameSet set;
  set.capture = "burst";
  set.frames = {frame_of(PixelFormat::Mono8, 10, 7, level)};
  const Parts parts(thumbnails_message(set, 4));  // ten pixels in at most four: blocks of three
  const json& camera = parts.head["cameras"][0];
  ASSERT_EQ(camera["scale"], 3);
  ASSERT_EQ(camera["width"], 3);
  ASSERT_EQ(camera["height"], 2);
  ASSERT_EQ(parts.payload.size(), 6u);
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 3; ++x) {
      int sum = 0;
      for (int i = 0; i < 9; ++i) sum += level(3 * x + i % 3, 3 * y + i / 3);
      EXPECT_EQ(parts.at(static_cast<std::size_t>(3 * y + x)), static_cast<unsigned>(sum / 9));
    }
  }
}

TEST(Thumbnails, TheHistogramCountsEveryPixelAndNamesTheSaturatedOnes) {
  FrameSet set;
  set.frames = {
      frame_of(PixelFormat::Mono8, 100, 10, [](int x, int y) { return y == 0 && x < 7 ? 255 : x; })};
  const Parts parts(thumbnails_message(set, 50));
  const json& camera = parts.head["cameras"][0];
  EXPECT_EQ(camera["saturated"], 7);
  EXPECT_EQ(camera["max"], 255);
  int all = 0;
  for (const auto& bin : camera["histogram"]) all += bin.get<int>();
  EXPECT_EQ(all, 1000);
  EXPECT_EQ(camera["histogram"].size(), 64u);
}

TEST(Thumbnails, ADamagedFrameIsLeftOut) {
  FrameSet set;
  Frame frame = frame_of(PixelFormat::Mono8, 10, 10, [](int, int) { return 1; });
  frame.height_px = 11;
  set.frames = {frame};
  EXPECT_TRUE(Parts(thumbnails_message(set, 50)).head["cameras"].empty());
  EXPECT_FALSE(frame_message(set, frame));
}

TEST(FrameMessage, KeepsEveryGreyLevelOfTwelveBits) {
  const auto level = [](int x, int y) { return (37 * x + 101 * y) % 4096; };
  FrameSet set;
  const auto message = frame_message(set, frame_of(PixelFormat::Mono12, 9, 5, level));
  ASSERT_TRUE(message);
  const Parts parts(*message);
  ASSERT_EQ(parts.payload.size(), 2u * 45u);
  for (int i = 0; i < 45; ++i) {
    const auto at = static_cast<std::size_t>(2 * i);
    EXPECT_EQ(parts.at(at) + 256 * parts.at(at + 1), static_cast<unsigned>(level(i % 9, i / 9)));
  }
}

TEST(VolumeMessage, IsWithinHalfAStepOfTheVolume) {
  Volume volume(centred_grid(6, 5, 4, 1.5));
  for (std::size_t i = 0; i < volume.values.size(); ++i)
    volume.values[i] = static_cast<float>(std::sin(0.7 * static_cast<double>(i)) + 0.3);
  RunRow run;
  run.run.id = "run";
  run.run.inputs = {{"burst", 3}};
  for (const int bits : {8, 16}) {
    const auto message = volume_message(volume, run, 42, {.most_side = 96, .bits = bits});
    ASSERT_TRUE(message);
    const Parts parts(*message);
    const double low = parts.head["low"], high = parts.head["high"], full = bits == 8 ? 255 : 65535;
    for (std::size_t i = 0; i < volume.values.size(); ++i) {
      const unsigned stored = bits == 8 ? parts.at(i) : parts.at(2 * i) + 256 * parts.at(2 * i + 1);
      EXPECT_NEAR(low + (high - low) * stored / full, volume.values[i], 0.51 * (high - low) / full);
    }
    EXPECT_EQ(parts.head["index"], 3);
    EXPECT_EQ(parts.head["pulse_time_ns"], 42);
  }
}

TEST(VolumeMessage, HidesNoInfinityAndDrawsAnEmptyFieldBlack) {
  Volume volume(centred_grid(3, 3, 3, 1));
  const auto empty = volume_message(volume, {}, 0, {});
  ASSERT_TRUE(empty);
  EXPECT_EQ(Parts(*empty).payload, std::string(27, '\0'));
  volume.values[5] = INFINITY;
  EXPECT_FALSE(volume_message(volume, {}, 0, {}));
}

LabState recording() {
  LabState state;
  CaptureState array;
  array.phase = CapturePhase::Armed;
  array.sets = array.sets_stored = 10;
  array.cameras = {
      {.name = "cam00", .address = "a", .connected = true, .frames = 10, .losses = {}, .newest_age_s = 0}};
  state.array = array;
  state.dispatcher = Status{};
  state.free_bytes = 100e9;
  state.sets_per_s = 5;
  state.bytes_per_set = 5e6;
  return state;
}

TEST(Alarms, AreSilentWhileAllIsWell) {
  EXPECT_TRUE(alarms_of(recording()).empty());
  EXPECT_DOUBLE_EQ(seconds_to_full(recording()).value(), 4000);
}

TEST(Alarms, NameWhatLosesData) {
  LabState state = recording();
  state.array->cameras[0].connected = false;
  state.array->cameras[0].losses["missed"] = 2;
  state.free_bytes = 1e9;
  state.dispatcher->failed = 1;
  const auto alarms = alarms_of(state);
  std::vector<std::string> names;
  for (const Alarm& alarm : alarms) names.push_back(alarm.what);
  EXPECT_EQ(names, (std::vector<std::string>{"camera-lost", "frames-lost", "disk-full", "jobs-failed"}));
  EXPECT_TRUE(alarms.front().is_severe);
  EXPECT_FALSE(alarms.back().is_severe);
  EXPECT_TRUE(alarms_of({}).size() >= 2) << "nobody answers";
}

TEST(RecipeJson, ComesBackAsItWent) {
  Recipe recipe{"mlem",
                {{"a.b", true}, {"a.i", std::int64_t{3}}, {"a.x", 0.5}, {"a.t", std::string("word")}}};
  const json body = {{"solver", recipe.solver}, {"settings", json::parse(settings_json_of(recipe).dump())}};
  EXPECT_EQ(recipe_from(body).value(), recipe);
  EXPECT_FALSE(recipe_from(json{{"settings", {{"a.b", json::array()}}}}));
  EXPECT_FALSE(recipe_from(json{{"solver", 3}}));
}

// The API without services: what it must answer when nothing was captured and nobody is there.
class EmptyApi : public testing::Test {
 protected:
  HttpResponse ask(const std::string& method, const std::string& target, const std::string& body = "") {
    const std::size_t question = target.find('?');
    HttpRequest request{method,
                        "/api/v1/" + target.substr(0, question),
                        question == std::string::npos ? "" : target.substr(question + 1),
                        {},
                        body};
    return answer_api(services_, target.substr(0, question), request)
        .value_or(HttpResponse{404, "", "", {}, {}});
  }
  Scratch folder_;
  Bus bus_;
  LiveServices services_{bus_, {"operator", "inproc://no-array", "inproc://no-dispatcher", folder_.path()}};
};

TEST_F(EmptyApi, ListsAreEmptyAndQuestionsAreChecked) {
  EXPECT_EQ(json::parse(ask("GET", "runs").body)["total"], 0);
  EXPECT_TRUE(json::parse(ask("GET", "captures").body)["captures"].empty());
  EXPECT_EQ(ask("GET", "runs/none").status, 404);
  EXPECT_EQ(ask("GET", "runs?limit=5000").status, 400);
  EXPECT_EQ(ask("GET", "runs?offset=-1").status, 400);
  EXPECT_EQ(ask("GET", "runs?sort=colour").status, 400);
  EXPECT_EQ(ask("GET", "runs//volume").status, 404);
  EXPECT_EQ(ask("POST", "capture", "no json").status, 400);
  EXPECT_EQ(ask("POST", "capture", R"({"kind": "holiday"})").status, 400);
  EXPECT_EQ(ask("POST", "capture", R"({"kind": "burst", "pulses": "many"})").status, 400);
  EXPECT_EQ(ask("POST", "capture", R"({"kind": "burst", "pulses": 0})").status, 400);
  EXPECT_EQ(ask("POST", "reprocess", R"({"runs": []})").status, 400);
}

TEST_F(EmptyApi, RecipesAreKeptCheckedAndDeleted) {
  EXPECT_EQ(
      ask("PUT", "recipes/mine", R"({"solver": "mlem", "settings": {"mlem.max_iterations": 7}})").status,
      200);
  EXPECT_EQ(
      ask("PUT", "recipes/mine", R"({"solver": "mlem", "settings": {"mlem.max_iterations": -7}})").status,
      400);
  EXPECT_EQ(ask("PUT", "recipes/..%2fmine", "{}").status, 400);
  const json recipes = json::parse(ask("GET", "recipes").body)["recipes"];
  EXPECT_EQ(recipes.back()["name"], "mine");
  EXPECT_EQ(recipes.back()["settings"]["mlem.max_iterations"], 7);
  EXPECT_GT(recipes.size(), 3u) << "and those that came with the program";
  EXPECT_EQ(ask("DELETE", "recipes/mine").status, 200);
  EXPECT_EQ(ask("DELETE", "recipes/mine").status, 404);
}

TEST_F(EmptyApi, EverySettingHasARangeAndAnExplanation) {
  const json solvers = json::parse(ask("GET", "solvers").body);
  EXPECT_GT(solvers["solvers"].size(), 10u);
  for (const auto& solver : solvers["solvers"]) {
    for (const auto& setting : solver["settings"]) {
      EXPECT_FALSE(setting["doc"].get<std::string>().empty()) << setting["key"];
      EXPECT_FALSE(setting["range"].get<std::string>().empty()) << setting["key"];
    }
  }
}

TEST(OpenApi, IsJsonAndDescribesCommandsAsGuarded) {
  const json doc = json::parse(openapi_json());
  for (const auto& [path, methods] : doc["paths"].items()) {
    for (const auto& [method, operation] : methods.items()) {
      EXPECT_EQ(operation.contains("security"), method != "get") << method << ' ' << path;
    }
  }
}

}  // namespace
}  // namespace flamefield
