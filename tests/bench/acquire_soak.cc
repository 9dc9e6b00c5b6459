// A long capture with scripted faults, checked against the truth in the pixels. The cameras are simulated in
// a process of their own, so that what this one uses is what receiving costs. Options: soak_acquire --help.
// Exit code 0: no picture in a wrong set, no loss that no fault explains, and at least 99.99 % of the sets
// without a scripted fault are complete.
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <map>
#include <mutex>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "acquire/camera_array.h"
#include "acquire/simulator/simulated_array.h"
#include "acquire/simulator/test_image.h"
#include "proto/check.h"
#include "proto/utc.h"

using namespace flamefield;

namespace {

using std::chrono::milliseconds;

struct Options {
  double seconds = 60;
  std::size_t cameras = 15;
  double rate_hz = 5;
  double loss = 0.005;
  int faults_of_each = 20;
  int packet_size = 1500;
  std::string format = "Mono8";
  std::string first_address = "127.98.0.2";
  std::int64_t pulses() const { return static_cast<std::int64_t>(seconds * rate_hz); }
};

constexpr std::int64_t kAway = 4;          // pulses that a dead or cut-off camera is away
constexpr std::int64_t kReturn_ms = 2000;  // it may take to deliver again

struct FaultKind {
  std::string_view name;
  std::int64_t may_lose;  // pulses of that camera, from the scripted one on
  bool is_away = false;   // and until it is back
};
constexpr std::array kKinds = {
    FaultKind{"missed", 1},         FaultKind{"unseen", 1},       FaultKind{"extra", 0},
    FaultKind{"drop", 0},           FaultKind{"leader", 1},       FaultKind{"trailer", 1},
    FaultKind{"mute", 1},           FaultKind{"reorder", 0},      FaultKind{"duplicate", 0},
    FaultKind{"repeat", 0},         FaultKind{"corrupt", 1},      FaultKind{"delay", 4},
    FaultKind{"dead", kAway, true}, FaultKind{"cut", kAway, true}};

struct ScriptedFault {
  const FaultKind* kind = nullptr;
  std::size_t camera = 0;
  std::int64_t pulse = 0;
};

std::vector<ScriptedFault> script(const Options& options) {
  std::vector<ScriptedFault> out;
  std::mt19937 random(7);
  std::vector<const FaultKind*> kinds;
  for (int i = 0; i < options.faults_of_each; ++i) {
    for (const FaultKind& kind : kKinds) kinds.push_back(&kind);
  }
  std::shuffle(kinds.begin(), kinds.end(), random);
  constexpr std::int64_t kSettling = 10;
  const auto room = static_cast<double>(options.pulses() - 2 * kSettling - 12);
  std::size_t camera = 0;
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    camera = (camera + 1 + random() % (options.cameras - 1)) % options.cameras;
    out.push_back({kinds[i], camera,
                   kSettling + static_cast<std::int64_t>(room * static_cast<double>(i) /
                                                         static_cast<double>(kinds.size()))});
  }
  return out;
}

// What both processes see.
struct Shared {
  std::atomic<int> stage{0};  // 1: cameras are there; 2: start the pulses; 3: over
  std::array<std::atomic<std::int64_t>, 1 << 17> edges_ns{};
};

int simulate(const Options& options, Shared& shared) {
  SimulatedArrayOptions array;
  array.cameras = options.cameras;
  array.first_address = options.first_address;
  array.first_frame_id = 65400;
  auto simulated = SimulatedArray::open(array);
  if (!simulated) {
    std::fprintf(stderr, "%s\n", simulated.error().message.c_str());
    shared.stage = 3;
    return 1;
  }
  std::vector<CameraFaults> faults(options.cameras);
  for (const ScriptedFault& fault : script(options)) {
    const bool is_away = fault.kind->is_away;
    const std::string when =
        is_away ? concat(fault.pulse, "-", fault.pulse + kAway - 1) : concat(fault.pulse);
    expect(add_fault(concat(fault.kind->name, "@", when), faults[fault.camera]).has_value(),
           "the kind is known");
  }
  for (std::size_t i = 0; i < options.cameras; ++i) {
    faults[i].packet_loss = options.loss;
    faults[i].extra_delay_ns = static_cast<std::int64_t>(0.3e9 / options.rate_hz);
    (*simulated)->set_faults(i, faults[i]);
  }
  shared.stage = 1;
  while (shared.stage < 2) std::this_thread::sleep_for(milliseconds(5));
  SignalGenerator& generator = (*simulated)->generator();
  (*simulated)->on_edge([&](const Pulse& pulse) {
    shared.edges_ns[static_cast<std::size_t>(pulse.number)] = pulse.time_ns;
  });
  generator.start(options.rate_hz, options.pulses());
  while (shared.stage < 3) std::this_thread::sleep_for(milliseconds(5));
  return 0;
}

double thread_cpu_s() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double process_cpu_s() {
  timespec now{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double rss_mib() {
  std::ifstream file("/proc/self/statm");
  double size = 0, resident = 0;
  file >> size >> resident;
  return resident * static_cast<double>(::sysconf(_SC_PAGESIZE)) / (1 << 20);
}

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1) + 0.5)];
}

// Judges every set as it comes; the frames are not kept.
class Judge {
 public:
  Judge(const Options& options, const Shared& shared) : options_(options), shared_(shared) {
    for (const ScriptedFault& fault : script(options)) {
      const auto back = static_cast<std::int64_t>(1e-3 * kReturn_ms * options.rate_hz) + 1;
      const std::int64_t end = fault.pulse + fault.kind->may_lose + (fault.kind->is_away ? back : 0);
      for (std::int64_t pulse = fault.pulse; pulse < end; ++pulse)
        excused_[{fault.camera, pulse}] = fault.kind;
      if (fault.kind->is_away) returns_.push_back({fault, -1});
    }
    for (const auto& [key, kind] : excused_) excused_pulses_.insert(key.second);
  }

  void judge(const FrameSet& set) {
    const std::int64_t now_ns = utc_now_ns();
    const double cpu_before_s = thread_cpu_s();
    const std::lock_guard lock(mutex_);
    const std::int64_t edge_ns = shared_.edges_ns[static_cast<std::size_t>(set.pulse)];
    const bool is_excused = excused_pulses_.contains(set.pulse);
    const double latency_ms = 1e-6 * static_cast<double>(now_ns - edge_ns);
    (is_excused ? excused_ms_ : clean_ms_).push_back(latency_ms);
    for (const Frame& frame : set.frames) {
      const std::size_t camera = std::stoul(frame.camera.substr(3));
      const auto stamp = read_test_image(frame);
      if (!stamp || stamp->camera != camera || stamp->pulse != set.pulse || stamp->is_stray) {
        ++misgrouped_;
        std::printf(
            "pulse %ld: %s holds %s\n", static_cast<long>(set.pulse), frame.camera.c_str(),
            stamp ? concat("pulse ", stamp->pulse, " of camera ", stamp->camera).c_str() : "no test image");
      }
      for (auto& [fault, return_ns] : returns_) {
        if (fault.camera == camera && return_ns < 0 && set.pulse >= fault.pulse + kAway) {
          return_ns = now_ns - shared_.edges_ns[static_cast<std::size_t>(fault.pulse + kAway)];
        }
      }
    }
    for (const FrameLoss& loss : set.losses) {
      const std::size_t camera = std::stoul(loss.camera.substr(3));
      const auto excuse = excused_.find({camera, set.pulse});
      ++losses_[std::string(excuse == excused_.end() ? "UNEXPLAINED" : excuse->second->name)]
               [std::string(name_of(loss.cause))];
      if (excuse != excused_.end()) continue;
      ++unexplained_;
      std::printf("pulse %ld: %s lost (%s) without a scripted fault\n", static_cast<long>(set.pulse),
                  loss.camera.c_str(), std::string(name_of(loss.cause)).c_str());
    }
    if (!is_excused) ++clean_sets_, clean_complete_ += set.losses.empty();
    ++sets_;
    cpu_s_ += thread_cpu_s() - cpu_before_s;
  }

  // From another thread: cameras that are given up at this moment.
  void watch(const std::vector<std::string>& lost) {
    const std::int64_t now_ns = utc_now_ns();
    const std::lock_guard lock(mutex_);
    for (const auto& [fault, unused] : returns_) {
      const std::int64_t edge_ns = shared_.edges_ns[static_cast<std::size_t>(fault.pulse)];
      const auto key = std::pair(fault.camera, fault.pulse);
      const bool is_away =
          edge_ns > 0 && shared_.edges_ns[static_cast<std::size_t>(fault.pulse + kAway)] == 0;
      if (!is_away || flagged_ms_.contains(key)) continue;
      const std::string name = concat("cam", fault.camera < 10 ? "0" : "", fault.camera);
      if (std::find(lost.begin(), lost.end(), name) != lost.end())
        flagged_ms_[key] = 1e-6 * static_cast<double>(now_ns - edge_ns);
    }
  }

  bool report(const CaptureReport& capture, double cpu_s, double wall_s, double first_rss_mib,
              double most_rss_mib) {
    const std::lock_guard lock(mutex_);
    const double share =
        clean_sets_ > 0 ? static_cast<double>(clean_complete_) / static_cast<double>(clean_sets_) : 1;
    std::printf("cameras %zu  rate_hz %g  loss %g  pulses %ld  sets %ld  scripted_faults %zu\n",
                options_.cameras, options_.rate_hz, options_.loss, static_cast<long>(options_.pulses()),
                static_cast<long>(sets_), script(options_).size());
    std::printf("misgrouped %ld  unexplained_losses %ld  sets_without_fault %ld  of_these_complete %.4f %%\n",
                static_cast<long>(misgrouped_), static_cast<long>(unexplained_),
                static_cast<long>(clean_sets_), 100 * share);
    std::printf(
        "pulse_to_set_ms without fault: p50 %.1f p99 %.1f max %.1f; with: p50 %.1f p99 %.1f max %.1f\n",
        quantile(clean_ms_, 0.5), quantile(clean_ms_, 0.99), quantile(clean_ms_, 1),
        quantile(excused_ms_, 0.5), quantile(excused_ms_, 0.99), quantile(excused_ms_, 1));
    std::printf(
        "receive_cpu %.1f %% of a core (checking the pixels %.1f %% not counted)  rss_mib %.0f after 10 %%, "
        "at most %.0f\n",
        100 * (cpu_s - cpu_s_) / wall_s, 100 * cpu_s_ / wall_s, first_rss_mib, most_rss_mib);
    for (const auto& [fault, causes] : losses_) {
      std::printf("  losses by fault %-11s", fault.c_str());
      for (const auto& [cause, count] : causes)
        std::printf("  %s %ld", cause.c_str(), static_cast<long>(count));
      std::printf("\n");
    }
    std::vector<double> flagged, returned;
    bool all_back = true;
    for (const auto& [key, ms] : flagged_ms_) flagged.push_back(ms);
    for (const auto& [fault, return_ns] : returns_) {
      all_back = all_back && return_ns >= 0;
      returned.push_back(1e-9 * static_cast<double>(return_ns));
    }
    std::printf(
        "cameras away %zu  given up %zu, after ms p50 %.0f max %.0f; delivered again after s p50 %.2f max "
        "%.2f%s\n",
        returns_.size(), flagged.size(), quantile(flagged, 0.5), quantile(flagged, 1),
        quantile(returned, 0.5), quantile(returned, 1), all_back ? "" : "  NOT ALL CAME BACK");
    std::int64_t extra = 0, late = 0, duplicates = 0, slips = 0, rejoins = 0, unplaced = 0;
    bool balances = capture.pulses == sets_ && capture.pulses == options_.pulses();
    for (const CameraReceipt& camera : capture.cameras) {
      const CameraTally& tally = camera.tally;
      extra += tally.extra, late += tally.late, duplicates += tally.duplicates, slips += tally.count_slips;
      rejoins += camera.rejoins, unplaced += tally.unplaced;
      std::int64_t sum = tally.delivered;
      for (std::int64_t count : tally.losses) sum += count;
      balances = balances && sum == capture.pulses;
    }
    std::printf(
        "extra %ld  late %ld  duplicates %ld  counters_set_right %ld  rejoins %ld  unplaced %ld  receipts "
        "%s\n",
        static_cast<long>(extra), static_cast<long>(late), static_cast<long>(duplicates),
        static_cast<long>(slips), static_cast<long>(rejoins), static_cast<long>(unplaced),
        balances ? "balance" : "DO NOT BALANCE");
    return misgrouped_ == 0 && unexplained_ == 0 && share >= 0.9999 && balances && all_back;
  }

 private:
  const Options options_;
  const Shared& shared_;
  std::mutex mutex_;
  std::map<std::pair<std::size_t, std::int64_t>, const FaultKind*> excused_;
  std::set<std::int64_t> excused_pulses_;
  std::vector<std::pair<ScriptedFault, std::int64_t>> returns_;  // and how long after the return it delivered
  std::map<std::pair<std::size_t, std::int64_t>, double> flagged_ms_;
  std::map<std::string, std::map<std::string, std::int64_t>> losses_;
  std::vector<double> clean_ms_, excused_ms_;
  std::int64_t misgrouped_ = 0, unexplained_ = 0, sets_ = 0, clean_sets_ = 0, clean_complete_ = 0;
  double cpu_s_ = 0;
};

int fail(const Error& error, Shared& shared) {
  std::fprintf(stderr, "%s\n", error.message.c_str());
  shared.stage = 3;
  return 1;
}

int receive(const Options& options, Shared& shared) {
  while (shared.stage < 1) std::this_thread::sleep_for(milliseconds(5));
  if (shared.stage == 3) return 1;
  CameraSettings settings;
  settings.test_image = true;
  settings.packet_size_bytes = options.packet_size;
  settings.pixel_format = pixel_format_from_name(options.format).value_or(PixelFormat::Mono8);
  std::vector<CameraAddress> addresses;
  for (std::size_t i = 0; i < options.cameras; ++i) {
    const std::size_t dot = options.first_address.rfind('.');
    const std::size_t last = std::stoul(options.first_address.substr(dot + 1)) + i;
    addresses.push_back(
        {concat("cam", i < 10 ? "0" : "", i), concat(options.first_address.substr(0, dot), ".", last)});
  }
  auto array = CameraArray::open(addresses, settings);
  if (!array) return fail(array.error(), shared);
  Judge judge(options, shared);
  const auto started = (*array)->start({.capture = "soak", .pulses = options.pulses()},
                                       [&](const FrameSet& set) { judge.judge(set); });
  if (!started) return fail(started.error(), shared);
  const double cpu_before_s = process_cpu_s();
  const auto begin = std::chrono::steady_clock::now();
  shared.stage = 2;
  double first_rss_mib = 0, most_rss_mib = 0;
  const auto end = begin + std::chrono::duration<double>(options.seconds + 15);
  while (!(*array)->wait_done(milliseconds(options.faults_of_each > 0 ? 5 : 500)) &&
         std::chrono::steady_clock::now() < end) {
    const CaptureProgress progress = (*array)->progress();
    judge.watch(progress.lost_cameras);
    if (progress.sets * 10 < options.pulses()) {
      first_rss_mib = rss_mib();
    } else {
      most_rss_mib = std::max(most_rss_mib, rss_mib());
    }
  }
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const double used_s = process_cpu_s() - cpu_before_s;
  const CaptureReport report = (*array)->stop();
  shared.stage = 3;
  return judge.report(report, used_s, wall_s, first_rss_mib, most_rss_mib) ? 0 : 1;
}

void add_options(CLI::App& app, Options& o) {
  app.option_defaults()->always_capture_default()->take_last();
  app.add_option("--seconds", o.seconds, "length of the capture");
  app.add_option("--cameras", o.cameras, "simulated cameras");
  app.add_option("--rate-hz", o.rate_hz, "pulses per second");
  app.add_option("--loss", o.loss, "share of packets lost");
  app.add_option("--faults-of-each", o.faults_of_each, "scripted faults of every kind");
  app.add_option("--packet-size", o.packet_size, "bytes");
  app.add_option("--format", o.format, "pixel format");
  app.add_option("--first-address", o.first_address, "of the simulated cameras");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("A long simulated capture with scripted faults");
  Options options;
  add_options(app, options);
  CLI11_PARSE(app, argc, argv);
  void* memory = ::mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED || options.pulses() + 64 > (1 << 17)) return 2;
  auto* shared = new (memory) Shared;
  const pid_t child = ::fork();  // before there are threads
  if (child == 0) std::_Exit(simulate(options, *shared));
  const int result = receive(options, *shared);
  int status = 0;
  ::waitpid(child, &status, 0);
  return result;
}
