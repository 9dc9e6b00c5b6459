#include <gtest/gtest.h>

#include <sstream>

#include "reconstruct/solver.h"
#include "services/config/lab_config.h"
#include "services/config/recipe_file.h"
#include "services/config/suggestion.h"
#include "services/serve/lab_cameras.h"
#include "services/store/file.h"
#include "tests/support/scratch.h"

namespace flamefield {
namespace {

// Stands for the stages: knows two solvers and one key of each.
Result<> small_check(const Recipe& recipe) {
  if (recipe.solver != "mlem" && recipe.solver != "sirt")
    return invalid_input("unknown solver '" + recipe.solver + "'", "it does not exist", "use mlem");
  for (const auto& [key, value] : recipe.settings) {
    if (key != "mlem.max_iterations" && key != "sirt.relaxation" && key != "mlem.note")
      return invalid_input("unknown key '" + key + "'", "no stage reads it", "remove it");
    if (key == "mlem.max_iterations" && !std::holds_alternative<std::int64_t>(value))
      return invalid_input("'" + key + "'", "not a whole number", "write one");
  }
  return {};
}

std::string recipe_fault(const std::string& text) {
  const Scratch scratch;
  overwrite(scratch / "r.toml", text);
  const auto recipe = read_recipe(scratch / "r.toml", small_check);
  return recipe ? "read" : recipe.error().message;
}

TEST(ShippedRecipes, AreAllValid) {
  int recipes = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(FLAMEFIELD_TEST_DATA "/../../deploy/recipes")) {
    if (entry.path().filename().string().starts_with("study-")) continue;  // read by study_test.cc
    const auto recipe = read_recipe(entry.path(), validate_recipe);
    EXPECT_TRUE(recipe) << recipe.error().message;
    ++recipes;
  }
  EXPECT_GE(recipes, 1);
}

TEST(RecipeFile, KeepsTypesAndText) {
  const Scratch scratch;
  const Recipe recipe{"sirt",
                      {{"mlem.max_iterations", std::int64_t{80}},
                       {"mlem.note", std::string("a \"quoted\" \\ text\n")},
                       {"sirt.relaxation", 1.0}}};
  ASSERT_TRUE(write_recipe(scratch / "r.toml", recipe));
  const auto back = read_recipe(scratch / "r.toml", small_check);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(*back, recipe);
  EXPECT_EQ(fingerprint(*back), fingerprint(recipe));
}

TEST(RecipeFile, NamesTheLineOfEveryFault) {
  EXPECT_NE(recipe_fault("solver = \"mlem\"\n\n[mlem]\nmax_iteratoins = 3\n").find("r.toml:4: unknown key"),
            std::string::npos);
  EXPECT_NE(recipe_fault("# a\nsolver = \"mlme\"\n").find("r.toml:2: unknown solver 'mlme'"),
            std::string::npos);
  EXPECT_NE(recipe_fault("[mlem]\nmax_iterations = 3.5\n").find("r.toml:2: "), std::string::npos);
  EXPECT_NE(recipe_fault("\n\nsolvr = \"mlem\"\n").find("r.toml:3: unknown key 'solvr'"), std::string::npos);
  EXPECT_NE(recipe_fault("[mlem]\nmax_iterations = [1, 2]\n").find("r.toml:2: "), std::string::npos);
  EXPECT_NE(recipe_fault("solver = 3\n").find("r.toml:1: "), std::string::npos);
  EXPECT_NE(recipe_fault("[mlem]\nmax_iterations = \n").find("r.toml:2: not valid TOML"), std::string::npos)
      << recipe_fault("[mlem]\nmax_iterations = \n");
  EXPECT_NE(recipe_fault("[mlem]\nmax_iterations = 1979-05-27\n").find("r.toml:2: "), std::string::npos);
}

TEST(RecipeFile, CutShortAnywhereNeverCrashes) {
  const std::string text = "solver = \"mlem\"\n[mlem]\nmax_iterations = 30\nnote = \"x\\u00e9\"\n";
  for (std::size_t length = 0; length < text.size(); ++length) recipe_fault(text.substr(0, length));
}

std::string lab_fault(const std::string& text) {
  const Scratch scratch;
  overwrite(scratch / "lab.toml", text);
  const auto lab = read_lab_config(scratch / "lab.toml");
  return lab ? "read" : lab.error().message;
}

TEST(LabConfig, TakesWhatIsGivenAndDefaultsForTheRest) {
  const Scratch scratch;
  overwrite(scratch / "lab.toml",
            "laboratory = \"Aachen\"\ndata_directory = \"runs\"\n[[camera]]\nname = \"cam00\"\naddress = "
            "\"10.0.0.2\"\n"
            "[[camera]]\nname = \"cam01\"\naddress = \"10.0.0.3\"\n[trigger]\nrate_hz = 10\n[capture]\n"
            "pixel_format = \"Mono12\"\n[reconstruction]\nsize = [40, 50, 60]\nspacing_mm = 0.5\n"
            "origin_mm = [-10, 0, -15.0]\n[web]\nport = 0\n");
  const auto lab = read_lab_config(scratch / "lab.toml");
  ASSERT_TRUE(lab) << lab.error().message;
  EXPECT_EQ(lab->laboratory, "Aachen");
  EXPECT_EQ(lab->data_directory, scratch / "runs");
  ASSERT_EQ(lab->cameras.size(), 2u);
  EXPECT_EQ(lab->cameras[1].address, "10.0.0.3");
  EXPECT_EQ(lab->trigger_rate_hz, 10);
  EXPECT_EQ(lab->exposure_us, 1000);
  EXPECT_EQ(lab->pixel_format, PixelFormat::Mono12);
  EXPECT_EQ(lab->domain.nz, 60);
  EXPECT_EQ(lab->domain.spacing_mm[1], 0.5);
  EXPECT_EQ(lab->domain.origin_mm, Eigen::Vector3d(-10, 0, -15));
  EXPECT_EQ(lab->http_port, 0);
}

TEST(LabConfig, AnEmptyFileIsTheEmbeddedDefault) {
  EXPECT_EQ(lab_fault(""), "read");
}

const std::filesystem::path kSample = FLAMEFIELD_TEST_DATA "/../../deploy/lab.toml";

TEST(LabConfig, TheSampleSaysTheDefaults) {
  const auto lab = read_lab_config(kSample);
  ASSERT_TRUE(lab) << lab.error().message;
  const LabConfig defaults;
  EXPECT_EQ(lab->laboratory, defaults.laboratory);
  EXPECT_EQ(lab->data_directory.filename(), defaults.data_directory);
  EXPECT_TRUE(lab->cameras.empty());
  EXPECT_EQ(lab->trigger_rate_hz, defaults.trigger_rate_hz);
  EXPECT_EQ(lab->trigger_source, defaults.trigger_source);
  EXPECT_EQ(lab->trigger_line, defaults.trigger_line);
  EXPECT_EQ(lab->action_device_key, defaults.action_device_key);
  EXPECT_EQ(lab->action_group_key, defaults.action_group_key);
  EXPECT_EQ(lab->action_group_mask, defaults.action_group_mask);
  EXPECT_EQ(lab->action_broadcast, defaults.action_broadcast);
  EXPECT_EQ(lab->width_px, defaults.width_px);
  EXPECT_EQ(lab->height_px, defaults.height_px);
  EXPECT_EQ(lab->offset_x_px, defaults.offset_x_px);
  EXPECT_EQ(lab->offset_y_px, defaults.offset_y_px);
  EXPECT_EQ(lab->history_pulses, defaults.history_pulses);
  EXPECT_EQ(lab->history_mib, defaults.history_mib);
  EXPECT_EQ(lab->exposure_us, defaults.exposure_us);
  EXPECT_EQ(lab->gain_db, defaults.gain_db);
  EXPECT_EQ(lab->pixel_format, defaults.pixel_format);
  EXPECT_EQ(lab->trigger_delay_us, defaults.trigger_delay_us);
  EXPECT_EQ(lab->black_level_raw, defaults.black_level_raw);
  EXPECT_EQ(lab->binning_x, defaults.binning_x);
  EXPECT_EQ(lab->binning_y, defaults.binning_y);
  EXPECT_EQ(lab->packet_size_bytes, defaults.packet_size_bytes);
  EXPECT_EQ(lab->link_mbit_per_s, defaults.link_mbit_per_s);
  EXPECT_EQ(lab->switch_buffer_kib, defaults.switch_buffer_kib);
  EXPECT_EQ(lab->simulated_cameras, defaults.simulated_cameras);
  EXPECT_EQ(lab->simulator_seed, defaults.simulator_seed);
  EXPECT_EQ(lab->simulated_flame, defaults.simulated_flame);
  EXPECT_EQ(lab->http_host, defaults.http_host);
  EXPECT_EQ(lab->http_port, defaults.http_port);
  EXPECT_EQ(lab->dispatcher_endpoint, defaults.dispatcher_endpoint);
  EXPECT_EQ(lab->keys_directory, defaults.keys_directory);
  EXPECT_EQ(lab->rig, defaults.rig);
  EXPECT_EQ(lab->recipe, defaults.recipe);
  EXPECT_EQ(lab->workers, defaults.workers);
  EXPECT_EQ(lab->threads_per_worker, defaults.threads_per_worker);
  EXPECT_EQ(lab->domain, defaults.domain);
  const ClusterConfig &cluster = lab->cluster, &usual = defaults.cluster;
  EXPECT_TRUE(cluster.partition.empty() && cluster.sbatch.empty() && cluster.directory.empty());
  EXPECT_EQ(cluster.pilots, usual.pilots);
  EXPECT_EQ(cluster.cores, usual.cores);
  EXPECT_EQ(cluster.memory_mib, usual.memory_mib);
  EXPECT_EQ(cluster.minutes, usual.minutes);
  EXPECT_EQ(cluster.most_minutes, usual.most_minutes);
  EXPECT_EQ(cluster.idle_s, usual.idle_s);
  EXPECT_EQ(cluster.drain_s, usual.drain_s);
  EXPECT_EQ(cluster.silence_s, usual.silence_s);
  EXPECT_EQ(cluster.key_days, usual.key_days);
}

TEST(LabConfig, TakesWhatAClusterNeeds) {
  const Scratch scratch;
  overwrite(scratch / "lab.toml",
            "[cluster]\npartition = \"night\"\nsbatch = [\"--qos=low\", \"--exclusive\"]\ndirectory = "
            "\"shared\"\n");
  const auto lab = read_lab_config(scratch / "lab.toml");
  ASSERT_TRUE(lab) << lab.error().message;
  EXPECT_EQ(lab->cluster.partition, "night");
  EXPECT_EQ(lab->cluster.sbatch, (std::vector<std::string>{"--qos=low", "--exclusive"}));
  EXPECT_EQ(lab->cluster.directory, scratch / "shared");
  EXPECT_NE(lab_fault("[cluster]\nsbatch = \"--exclusive\"\n").find(":2: "), std::string::npos);
  EXPECT_NE(lab_fault("[cluster]\nsbatch = [3]\n").find("not a list of texts"), std::string::npos);
  EXPECT_NE(lab_fault("[cluster]\npilots = 0\n").find("cluster.pilots"), std::string::npos);
}

TEST(LabConfig, TheSampleShowsEveryKey) {
  const std::string sample = *read_text_file(kSample);
  // A key far from all others is answered with the list of all.
  const std::string fault = lab_fault("qqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqq = 1\n");
  const auto list = fault.find("choose one of: ");
  ASSERT_NE(list, std::string::npos) << fault;
  std::istringstream names(fault.substr(list + 15));
  int count = 0;
  for (std::string name; names >> name; ++count) {
    const std::string key = name.substr(name.rfind('.') + 1);
    const std::string line = (key == "origin_mm" ? "\n# " : "\n") + key + " = ";
    EXPECT_NE(sample.find(line), std::string::npos) << name;
  }
  EXPECT_GT(count, 20);
}

TEST(LabConfig, TakesTheEndpointsOfTheBus) {
  const Scratch scratch;
  overwrite(scratch / "lab.toml",
            "[bus]\ndispatcher = \"tcp://10.0.0.1:7300\"\nevents = \"tcp://10.0.0.1:7301\"\n"
            "acquisition = \"tcp://10.0.0.1:7302\"\n");
  const auto lab = read_lab_config(scratch / "lab.toml");
  ASSERT_TRUE(lab) << lab.error().message;
  EXPECT_EQ(lab->dispatcher_endpoint, "tcp://10.0.0.1:7300");
  EXPECT_EQ(lab->events_endpoint, "tcp://10.0.0.1:7301");
  EXPECT_EQ(lab->acquisition_endpoint, "tcp://10.0.0.1:7302");
}

TEST(LabConfig, TakesRegionHistoryAndActionTrigger) {
  const Scratch scratch;
  overwrite(
      scratch / "lab.toml",
      "[trigger]\nsource = \"action\"\naction_group_mask = 6\naction_broadcast = \"10.0.0.255\"\n[capture]\n"
      "width_px = 320\nheight_px = 240\noffset_x_px = 16\noffset_y_px = 8\nhistory_pulses = 9\n");
  const auto lab = read_lab_config(scratch / "lab.toml");
  ASSERT_TRUE(lab) << lab.error().message;
  const AcquisitionOptions options = acquisition_of(*lab);
  EXPECT_EQ(options.settings.trigger_source, "Action1");
  ASSERT_TRUE(options.settings.action);
  EXPECT_EQ(options.settings.action->group_mask, 6u);
  EXPECT_EQ(options.settings.action->broadcast_address, "10.0.0.255");
  EXPECT_EQ(options.action_rate_hz, 5);
  ASSERT_TRUE(options.settings.region);
  EXPECT_EQ(options.settings.region->width_px, 320);
  EXPECT_EQ(options.settings.region->offset_y_px, 8);
  EXPECT_EQ(options.history.pulses, 9);
  EXPECT_EQ(bandwidth_needs_of(*lab).height_px, 240);
  EXPECT_NE(lab_fault("[capture]\nwidth_px = 320\n").find("lab.toml:2: "), std::string::npos);
  EXPECT_NE(lab_fault("[capture]\noffset_x_px = 3\n").find("lab.toml:2: "), std::string::npos);
  EXPECT_NE(lab_fault("[trigger]\nsource = \"actoin\"\n").find("did you mean 'action'?"), std::string::npos);
}

TEST(LabConfig, NamesTheLineOfEveryFault) {
  EXPECT_NE(lab_fault("[trigger]\nrat_hz = 5\n").find("lab.toml:2: unknown key 'trigger.rat_hz'"),
            std::string::npos);
  EXPECT_NE(lab_fault("[trigger]\nrat_hz = 5\n").find("did you mean 'trigger.rate_hz'?"), std::string::npos);
  EXPECT_NE(lab_fault("[trigger]\nrate_hz = \"5\"\n").find("lab.toml:2: "), std::string::npos);
  EXPECT_NE(lab_fault("\n[web]\nport = 70000\n").find("lab.toml:3: "), std::string::npos);
  EXPECT_NE(lab_fault("[web]\nport = 80.5\n").find("lab.toml:2: "), std::string::npos);
  EXPECT_NE(lab_fault("[capture]\npixel_format = \"Mono10\"\n").find("lab.toml:2: "), std::string::npos);
  EXPECT_NE(
      lab_fault("[[camera]]\nname = \"a\"\naddress = \"1\"\n[[camera]]\nname = \"a\"\naddress = \"2\"\n")
          .find("lab.toml:5: "),
      std::string::npos);
  EXPECT_NE(lab_fault("[[camera]]\nname = \"a\"\n").find("no address"), std::string::npos);
  EXPECT_NE(lab_fault("[reconstruction]\nsize = [1, 2]\n").find("lab.toml:2: "), std::string::npos);
}

TEST(Suggestion, NamesTheNearestOrAll) {
  EXPECT_EQ(suggest("trous", {"torus", "bunsen"}), "did you mean 'torus'?");
  EXPECT_EQ(suggest("xyz", {"torus", "bunsen"}), "choose one of: torus bunsen");
}

}  // namespace
}  // namespace flamefield
