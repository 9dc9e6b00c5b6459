#include <gtest/gtest.h>

#include "services/config/lab_config.h"
#include "services/config/recipe_file.h"
#include "services/config/suggestion.h"
#include "services/store/file.h"
#include "tests/services/scratch.h"

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
