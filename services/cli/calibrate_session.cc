#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <iostream>
#include <thread>

#include "proto/utc.h"
#include "services/calibration/output.h"
#include "services/cli/board_options.h"
#include "services/cli/commands.h"
#include "services/cli/connection.h"
#include "services/cli/options.h"
#include "services/ledger/reader.h"
#include "services/store/file.h"
#include "services/store/rig_file.h"

namespace flamefield {

namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using Clock = std::chrono::steady_clock;

struct Options {
  DataOption data;
  BoardOptions board;
  std::vector<double> reference_centre_mm;
  std::optional<double> reference_azimuth_deg;
  std::int64_t poses = 20;
  double patience_s = 60;
  bool automatic = false, accept = false, json = false;
  std::string accepted_by, note;
  std::filesystem::path out;
};

std::string user_name() {
  const char* name = std::getenv("USER");
  return name ? name : "";
}

StartCalibration request_of(const Options& options) {
  StartCalibration request;
  if (options.board.square_mm > 0) request.board = board_of(options.board);
  if (!options.reference_centre_mm.empty())
    request.reference_centre_mm = Eigen::Vector3d::Map(options.reference_centre_mm.data());
  if (options.reference_azimuth_deg)
    request.reference_azimuth_rad = rad_of_deg(*options.reference_azimuth_deg);
  request.wanted_poses = options.poses;
  request.automatic = options.automatic;
  return request;
}

// The key that was pressed; 0: none.
char pressed_key(milliseconds wait) {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  if (::poll(&input, 1, static_cast<int>(wait.count())) <= 0) return 0;
  char key = 0;
  return ::read(STDIN_FILENO, &key, 1) == 1 ? key : 0;
}

std::string cameras_text(const CalibrationState& state) {
  std::string out;
  for (const auto& camera : state.cameras)
    out += fmt::format("  {:<10} {}  {:>2} boards, {:>3.0f} % of its picture  {}\n", camera.name,
                       camera.sees_board ? "sees it" : "-      ", camera.boards, 100 * camera.coverage,
                       camera.sees_board ? "" : camera.last_reason);
  return out;
}

std::string needed_text(const CalibrationState& state) {
  std::string out;
  constexpr std::size_t kShown = 4;
  for (std::size_t i = 0; i < std::min(kShown, state.needed.size()); ++i)
    out += concat("  -> ", state.needed[i], "\n");
  if (state.needed.size() > kShown) out += concat("     and ", state.needed.size() - kShown, " more\n");
  return out;
}

// One session from its start to its end; whatever ends it early discards it.
class GuidedSession {
 public:
  GuidedSession(const Options& options, const Session& session)
      : options_(options),
        session_(session),
        connection_(connect_to(options.data)),
        client_(or_fail(Client::connect(*connection_.bus, "operator", unique_name("calibrate"),
                                        connection_.endpoints.calibration))) {}
  ~GuidedSession() {
    if (is_open_) (void)client_.ask(DiscardCalibration{}, seconds(60));
  }

  void run() {
    state_ = or_fail(client_.ask_for<CalibrationState>(request_of(options_), seconds(60)));
    is_open_ = true;
    take_poses();
    solve();
    if (decide()) accept();
    if (options_.json) std::cout << json_text(state_);
  }

 private:
  void refresh() {
    session_.check_stop();
    state_ = or_fail(client_.ask_for<CalibrationState>(GetCalibration{}, seconds(60)));
  }

  void take_poses() {
    if (!options_.automatic)
      std::cerr << "keys (then Enter): t take this pose, s solve, q give up. The first pose is the board in "
                   "its holder "
                   "on the burner.\n";
    auto last_news = Clock::now();
    std::int64_t poses = -1;
    for (;;) {
      const char key = options_.automatic ? (std::this_thread::sleep_for(milliseconds(100)), '\0')
                                          : pressed_key(milliseconds(250));
      if (key == 't') (void)or_fail(client_.ask(TakePose{}, seconds(60)));
      if (key == 'q') throw CommandFailure{ExitCode::Failed, "calibration session given up (q was pressed)"};
      if (key == 's') return;
      refresh();
      report_news(poses);
      if (state_.poses != poses) {
        poses = state_.poses;
        last_news = Clock::now();
      }
      if (!options_.automatic) continue;
      if (poses >= options_.poses && state_.links_missing.empty()) return;
      if (std::chrono::duration<double>(Clock::now() - last_news).count() > options_.patience_s) give_up();
    }
  }

  void report_news(std::int64_t poses_before) {
    if (state_.error != error_) {
      error_ = state_.error;
      if (!error_.empty()) std::cerr << error_ << '\n';
    }
    if (state_.poses == poses_before) return;
    if (state_.poses > 0)
      std::cerr << state_.message << " (" << state_.poses << " of " << options_.poses << ")\n";
    if (!options_.automatic) std::cerr << cameras_text(state_);
    std::cerr << needed_text(state_) << std::flush;
  }

  [[noreturn]] void give_up() {
    std::string why =
        state_.error.empty() ? "no camera saw the board still and in a new place" : state_.error;
    throw CommandFailure{ExitCode::Failed,
                         fmt::format("no new pose for {:.0f} s ({}) {}", options_.patience_s, why,
                                     state_.needed.empty() ? "move the board" : state_.needed.front())};
  }

  void solve() {
    (void)or_fail(client_.ask(SolveCalibration{}, seconds(60)));
    do {
      std::this_thread::sleep_for(milliseconds(100));
      refresh();
    } while (state_.phase == CalibrationPhase::Solving);
    if (state_.phase != CalibrationPhase::Solved) throw CommandFailure{ExitCode::Failed, state_.error};
    std::cerr << fmt::format(
        "{} poses: RMS {:.3f} px, expected error in the measuring volume {:.3f} px, worst {:.3f} px ({}): "
        "{}\n",
        state_.poses, state_.rms_px, state_.volume_mean_px, state_.volume_worst_px, state_.worst_camera,
        state_.verdict);
    if (state_.previous_version > 0) {
      for (const auto& camera : state_.cameras)
        std::cerr << fmt::format("  {:<10} {:>7.3f} px off calibration {}{}\n", camera.name, camera.shift_px,
                                 state_.previous_version, camera.moved ? "  moved" : "");
    }
    if (!state_.report.empty())
      std::cerr << "report: " << (options_.data.dir / state_.report).string() << '\n';
  }

  bool decide() const {
    if (options_.accept) return true;
    if (options_.automatic) return false;
    std::cerr << "accept? (y/n) " << std::flush;
    for (;;) {
      session_.check_stop();
      const char key = pressed_key(milliseconds(250));
      if (key == 'y') return true;
      if (key == 'n') return false;
    }
  }

  void accept() {
    const auto stored = or_fail(client_.ask_for<CalibrationStored>(
        AcceptCalibration{options_.accepted_by, options_.note}, seconds(60)));
    is_open_ = false;
    state_ = or_fail(client_.ask_for<CalibrationState>(GetCalibration{}, seconds(60)));
    std::cerr << "accepted as version " << stored.version << '\n';
    if (options_.out.empty()) return;
    auto reader = or_fail(LedgerReader::open(options_.data.dir));
    or_fail(write_rig(options_.out, or_fail(reader.calibration(stored.version)).rig));
  }

  const Options& options_;
  const Session& session_;
  Connection connection_;
  Client client_;
  CalibrationState state_;
  std::string error_;
  bool is_open_ = false;
};

void guide_session(const Options& options, const Session& session) {
  if (!options.out.empty()) or_fail(check_writable(options.out));
  GuidedSession(options, session).run();
}

struct HistoryOptions {
  DataOption data;
  std::int64_t version = 0;
  std::filesystem::path out;
  bool json = false;
};

void show_history(const HistoryOptions& options) {
  auto reader = or_fail(LedgerReader::open(options.data.dir));
  const auto all = or_fail(reader.calibrations());
  if (!options.out.empty()) {
    const std::int64_t version = options.version > 0 ? options.version : all.empty() ? 0 : all.back().version;
    or_fail(write_rig(options.out, or_fail(reader.calibration(version)).rig));
    return;
  }
  if (options.json) {
    std::cout << "[";
    for (std::size_t i = 0; i < all.size(); ++i) std::cout << (i > 0 ? "," : "") << '\n' << json_text(all[i]);
    std::cout << "]\n";
    return;
  }
  fmt::print("{:>7} {:>6} {:<20} {:<12} {:>6} {:>8} {:>8} {:<8} {:<24} {}\n", "VERSION", "AFTER",
             "ACCEPTED (UTC)", "BY", "POSES", "MEAN px", "WORST px", "VERDICT", "MOVED", "NOTE");
  for (const Calibration& c : all) {
    std::string moved;
    for (const std::string& camera : c.moved) moved += (moved.empty() ? "" : ",") + camera;
    fmt::print("{:>7} {:>6} {:<20} {:<12} {:>6} {:>8.3f} {:>8.3f} {:<8} {:<24} {}\n", c.version,
               c.predecessor == 0 ? "-" : fmt::format("{}", c.predecessor), utc_text(c.accepted_time_ns),
               c.accepted_by, c.poses, c.volume_mean_px, c.volume_worst_px, c.verdict,
               moved.empty() ? "-" : moved, c.note);
  }
  if (all.empty()) std::cout << "no calibration was accepted yet: flamefield calibrate session\n";
}

}  // namespace

void add_calibrate_session(CLI::App& calibrate, Session& session) {
  auto options = std::make_shared<Options>();
  options->accepted_by = user_name();
  auto* command = calibrate.add_subcommand(
      "session",
      "Guided, with a running 'flamefield serve': says what is still needed, takes poses, solves, compares "
      "with the calibration before, and keeps what is accepted");
  add_data(*command, options->data);
  add_board_options(*command, options->board)
      ->description("Side of a square. Left out: the board that 'serve' is configured for");
  command
      ->add_option("--reference-centre-mm", options->reference_centre_mm,
                   "Middle of the board in its holder on the burner: X,Y,Z. Default: as configured")
      ->delimiter(',')
      ->expected(3);
  command->add_option("--reference-azimuth-deg", options->reference_azimuth_deg, "Where its face looks");
  command->add_option("--poses", options->poses, "Board poses to take")
      ->check(CLI::Range(2, 1000))
      ->capture_default_str();
  command->add_flag(
      "--automatic", options->automatic,
      "Take every pose in which the board is held still in a new place, and solve when there are enough");
  command
      ->add_option("--patience-s", options->patience_s,
                   "Automatic: give up when no new pose comes for so long")
      ->capture_default_str();
  command->add_flag("--accept", options->accept, "Accept the result without asking");
  command->add_option("--by", options->accepted_by, "Who accepts it")->capture_default_str();
  command->add_option("--note", options->note, "Why, for the history");
  command->add_option("--out", options->out, "Write the accepted rig here, too");
  command->add_flag("--json", options->json, "Print the last state as JSON");
  command->footer(
      "Examples:\n"
      "  flamefield calibrate session\n"
      "  flamefield calibrate session --automatic --poses 20 --accept --note \"cam03 was bumped\"");
  command->callback(
      [options, &session] { session.choose([=, &session] { guide_session(*options, session); }); });
}

void add_calibrate_history(CLI::App& calibrate, Session& session) {
  auto options = std::make_shared<HistoryOptions>();
  auto* command = calibrate.add_subcommand("history", "Calibrations that were accepted");
  add_data(*command, options->data);
  command->add_option("--version", options->version, "Of --out; default: the newest")
      ->check(CLI::PositiveNumber);
  command->add_option("--out", options->out, "Write that version's rig instead of the list");
  command->add_flag("--json", options->json, "Print the list as JSON");
  command->footer(
      "Examples:\n"
      "  flamefield calibrate history\n"
      "  flamefield calibrate history --version 3 --out rig.yaml");
  command->callback([options, &session] { session.choose([=] { show_history(*options); }); });
}

}  // namespace flamefield
