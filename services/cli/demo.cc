#include <CLI/CLI.hpp>
#include <iostream>
#include <thread>

#include "services/cli/commands.h"
#include "services/cli/progress.h"
#include "services/cli/recipe_options.h"
#include "services/demo/demo.h"
#include "services/demo/summary.h"
#include "services/log/log.h"

namespace flamefield {

namespace {

struct Options {
  DemoOptions demo;
  RecipeOptions recipe;
  std::string flame;
  bool mono12 = false;
  bool keep_serving = false;
};

void print_result(const DemoOptions& options, const DemoSummary& summary, const std::string& page_url) {
  const auto path = [&](const char* name) { return std::filesystem::absolute(options.out / name).string(); };
  std::cout << "\n" << summary_table(summary) << "\n";
  std::cout << "  report     " << path("report.html") << "\n";
  std::cout << "  volumes    " << path("data/volumes") << "\n";
  std::cout << "  summary    " << path("summary.json") << "\n";
  std::cout << "  live page  " << (page_url.empty() ? "off (--port 0)" : page_url) << std::endl;
}

void run(Options& options, const Session& session) {
  options.demo.recipe = options.recipe.recipe();
  if (!options.flame.empty()) options.demo.flame = options.flame;
  if (options.mono12) options.demo.pixel_format = PixelFormat::Mono12;

  set_log_level(LogLevel::Warning);  // the stages say what happens
  // One line a stage: the bar of the running one, then how long it took.
  std::string stage;
  std::optional<ProgressBar> bar;
  auto started = std::chrono::steady_clock::now();
  const auto end_stage = [&] {
    if (!bar) return;
    bar.reset();
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
    std::fprintf(stderr, "%-48s %6.1f s\n", stage.c_str(), seconds);
  };
  const DemoProgress progress{[&](const std::string& name, std::int64_t done, std::int64_t total) {
    if (name != stage) {
      end_stage();
      stage = name;
      started = std::chrono::steady_clock::now();
      bar.emplace(name);
    }
    bar->update(static_cast<double>(done), static_cast<double>(total), concat(done, "/", total));
  }};
  or_fail(run_demo(options.demo, progress, session.stop(),
                   [&](const DemoSummary& summary, const std::string& url) {
                     end_stage();
                     print_result(options.demo, summary, url);
                     if (!options.keep_serving || url.empty()) return;
                     std::cout << "\n  The live page stays up until Ctrl-C." << std::endl;
                     while (!session.stop().stop_requested())
                       std::this_thread::sleep_for(std::chrono::milliseconds(100));
                   }));
}

}  // namespace

void add_demo(CLI::App& app, Session& session) {
  auto options = std::make_shared<Options>();
  DemoOptions& demo = options->demo;
  auto* command =
      app.add_subcommand("demo", "The main job on a simulated camera array, from calibration to report");
  command->add_option("--out", demo.out, "Folder for everything")->capture_default_str();
  command->add_option("--cameras", demo.cameras, "Simulated GigE Vision cameras")
      ->check(CLI::Range(3, 64))
      ->capture_default_str();
  command->add_option("--poses", demo.poses, "Poses of the calibration board")
      ->check(CLI::Range(4, 200))
      ->capture_default_str();
  command->add_option("--pulses", demo.pulses, "Pulses of the burst")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  command->add_option("--rate-hz", demo.rate_hz, "Trigger rate")
      ->check(CLI::Range(0.1, 100.0))
      ->capture_default_str();
  command->add_flag("--mono12", options->mono12, "12-bit images in place of 8-bit ones");
  command->add_option("--flame", options->flame,
                      "Show this field (.npy, .vtkhdf) in place of the simulated flame");
  command->add_option("--spacing-mm", demo.flame_spacing_mm, "Voxel size of a .npy field");
  command->add_option("--voxel-mm", demo.voxel_mm, "Voxel size of the reconstruction")
      ->check(CLI::Range(0.05, 50.0))
      ->capture_default_str();
  command->add_option("--seed", demo.seed, "Of flame, noise and mounting tolerances")->capture_default_str();
  command
      ->add_option("--first-address", demo.first_address,
                   "Loopback address of the first camera; the others follow")
      ->capture_default_str();
  command->add_option("--port", demo.http_port, "Of the live page on 127.0.0.1; 0: no page")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command->add_flag("--keep-serving", options->keep_serving, "Leave the live page up when the job is done");
  add_recipe(*command, options->recipe);
  command->footer(
      "Examples:\n"
      "  flamefield demo\n"
      "  flamefield demo --pulses 5 --poses 12 --out quick\n"
      "  flamefield demo --flame flame.npy --spacing-mm 1 --keep-serving");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
