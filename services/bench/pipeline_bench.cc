#include "services/bench/pipeline_bench.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <memory>
#include <thread>
#include <vector>

#include "reconstruct/phantom/phantom.h"
#include "reconstruct/render.h"
#include "reconstruct/ring.h"
#include "services/bench/stopwatch.h"
#include "services/bus/client.h"
#include "services/dispatcher/dispatcher.h"
#include "services/dispatcher/set_sender.h"
#include "services/ledger/reader.h"
#include "services/worker/reconstruct_job.h"

namespace flamefield {

namespace {

using namespace std::chrono_literals;

constexpr auto kPatience = 60s;

// What the array would deliver: 8-bit frames of a flame that fills a third of the sensors.
struct Laboratory {
  Grid grid;
  Rig rig;
  std::vector<Frame> frames;
};

Result<Laboratory> laboratory(const PipelineOptions& o) {
  Laboratory out;
  out.grid = centred_grid(o.nx, o.ny, o.nz, 1);
  auto rig = make_ring({.views = o.cameras,
                        .spacing_rad = 3.141592653589793 / o.cameras,
                        .radius_mm = 300,
                        .image_width_px = o.image_width_px,
                        .image_height_px = o.image_height_px},
                       centred_grid(2 * o.nx, 2 * o.ny, 2 * o.nz, 1));
  if (!rig) return tl::unexpected(rig.error());
  out.rig = std::move(*rig);
  const Volume flame = make_phantom({.kind = PhantomKind::Stratified}, out.grid);
  const Renderer renderer(flame);
  for (const Camera& camera : out.rig.cameras) {
    const Image image = renderer.view(camera, {});
    const float brightest = std::max(1e-9f, *std::ranges::max_element(image.pixels));
    std::vector<std::byte> bytes;
    for (float p : image.pixels) bytes.push_back(static_cast<std::byte>(std::lround(200 * p / brightest)));
    out.frames.push_back({.camera = camera.name,
                          .width_px = image.width_px,
                          .height_px = image.height_px,
                          .bytes = std::make_shared<const std::vector<std::byte>>(std::move(bytes))});
  }
  return out;
}

FrameSet set_of(const Laboratory& lab, int index) {
  FrameSet set;
  set.capture = "bench";
  set.index = set.pulse = index;
  set.pulse_time_ns = 1'700'000'000'000'000'000 + index * 200'000'000LL;
  set.complete_time_ns = set.pulse_time_ns + 1'000'000;
  set.frames = lab.frames;
  for (Frame& frame : set.frames) frame.pulse = index;
  return set;
}

Result<> put_sets(Client& client, const Laboratory& lab, const PipelineOptions& o, std::stop_token stop,
                  PipelineMeasurement& out) {
  std::vector<double> waits_ms;
  const Stopwatch watch;
  for (int i = 0; i < o.sets; ++i) {
    if (stop.stop_requested()) return unavailable("bench", "it was stopped", "start it again");
    const Stopwatch wait;
    if (auto ok = client.ask(PutSet{set_of(lab, i)}, kPatience); !ok) return tl::unexpected(ok.error());
    waits_ms.push_back(1e3 * wait.wall_s());
  }
  out.sets_per_s = o.sets / watch.wall_s();
  std::ranges::sort(waits_ms);
  const double rank = std::ceil(0.99 * o.sets);
  out.put_p99_ms = waits_ms[static_cast<std::size_t>(rank) - 1];
  return {};
}

// Sets offered as fast as they are taken.
Result<double> durable_sets_per_s(Bus& bus, const Laboratory& lab, int first, int count) {
  Dealer dealer(bus, "capture", unique_name("bench"));
  if (auto ok = dealer.connect("inproc://dispatcher"); !ok) return tl::unexpected(ok.error());
  SetSender sender(std::move(dealer), {.max_unacked = 32, .resend_after = kPatience});
  const Stopwatch watch;
  for (int i = first; i < first + count; ++i) {
    FrameSet set = set_of(lab, i);
    set.capture = "ceiling";
    while (!sender.offer(set)) sender.pump(10ms);
  }
  if (auto ok = sender.drain(kPatience); !ok) return tl::unexpected(ok.error());
  return count / watch.wall_s();
}

// The same bytes, one fdatasync a set.
Result<double> disk_sets_per_s(const std::filesystem::path& folder, std::size_t set_bytes, int count) {
  const std::filesystem::path path = folder / "disk-rate";
  const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  const std::vector<char> bytes(set_bytes, 'x');
  const auto size = static_cast<off_t>(set_bytes) * count;
  bool good = fd >= 0 && ::posix_fallocate(fd, 0, size) == 0 && ::fsync(fd) == 0;
  const Stopwatch watch;
  for (off_t at = 0; good && at < size; at += static_cast<off_t>(set_bytes))
    good =
        ::pwrite(fd, bytes.data(), set_bytes, at) == static_cast<ssize_t>(set_bytes) && ::fdatasync(fd) == 0;
  const double rate = count / watch.wall_s();
  const int reason = errno;
  if (fd >= 0) ::close(fd);
  ::unlink(path.c_str());
  if (!good)
    return unavailable(concat("cannot write ", path.string()), std::strerror(reason), "free disk space");
  return rate;
}

// In turns, since a disk's mood changes.
Result<> measure_ceiling(Bus& bus, const Laboratory& lab, const PipelineOptions& o,
                         PipelineMeasurement& out) {
  constexpr int kTurns = 3;
  const int each = std::max(1, o.durable_sets / kTurns);
  const auto set_bytes = static_cast<std::size_t>(out.set_mib * (1 << 20));
  double ours_s = 0, disk_s = 0;
  for (int turn = 0; turn < kTurns; ++turn) {
    const auto disk = disk_sets_per_s(o.data_dir, set_bytes, each);
    if (!disk) return tl::unexpected(disk.error());
    const auto ours = durable_sets_per_s(bus, lab, turn * each, each);
    if (!ours) return tl::unexpected(ours.error());
    disk_s += each / *disk, ours_s += each / *ours;
  }
  out.disk_sets_per_s = kTurns * each / disk_s;
  out.durable_sets_per_s = kTurns * each / ours_s;
  return {};
}

Result<> wait_done(Client& client, std::stop_token stop, int& failed) {
  std::int64_t before = -1;
  for (Stopwatch quiet; quiet.wall_s() < 60;) {
    const auto status = client.ask_for<Status>(GetStatus{}, kPatience);
    if (!status) return tl::unexpected(status.error());
    failed = static_cast<int>(status->failed);
    if (status->queued + status->leased == 0) return {};
    if (stop.stop_requested()) return unavailable("bench", "it was stopped", "start it again");
    if (status->queued + status->leased != before) quiet = Stopwatch();
    before = status->queued + status->leased;
    std::this_thread::sleep_for(5ms);
  }
  return unavailable("bench", "no volume was made for a minute", "use a faster recipe");
}

Result<> read_timings(const PipelineOptions& o, PipelineMeasurement& out) {
  auto reader = LedgerReader::open(o.data_dir);
  if (!reader) return tl::unexpected(reader.error());
  const auto runs = reader->runs();
  if (!runs) return tl::unexpected(runs.error());
  const double share = 1e3 / static_cast<double>(std::max<std::size_t>(runs->size(), 1));
  for (const RunRow& row : *runs) {
    const RunTimings& t = row.run.timings;
    out.fetch_ms += share * t.fetch_s;
    out.prepare_ms += share * t.prepare_s;
    out.solve_ms += share * t.solve_s;
    out.write_ms += share * t.write_s;
    out.first_prepare_ms = std::max(out.first_prepare_ms, 1e3 * t.prepare_s);
    out.first_solve_ms = std::max(out.first_solve_ms, 1e3 * t.solve_s);
  }
  return {};
}

}  // namespace

Result<PipelineMeasurement> measure_pipeline(const PipelineOptions& o, std::stop_token stop,
                                             const std::function<void(const std::string&)>& progress) {
  progress("render the flame");
  const auto lab = laboratory(o);
  if (!lab) return tl::unexpected(lab.error());
  PipelineMeasurement out;
  for (const Frame& frame : lab->frames) out.set_mib += static_cast<double>(frame.bytes->size()) / (1 << 20);

  Bus bus;
  auto dispatcher = Dispatcher::open(bus, {.data_dir = o.data_dir});
  if (!dispatcher) return tl::unexpected(dispatcher.error());
  std::jthread serving([&](std::stop_token end) { (void)(*dispatcher)->run(end); });
  auto client = Client::connect(bus, "operator", unique_name("bench"), "inproc://dispatcher");
  if (!client) return tl::unexpected(client.error());
  if (auto ok = client->ask(PutRig{lab->rig}, kPatience); !ok) return tl::unexpected(ok.error());
  progress(concat("store ", o.sets, " frame sets"));
  if (auto ok = put_sets(*client, *lab, o, stop, out); !ok) return tl::unexpected(ok.error());

  progress(concat("store ", o.durable_sets, " frame sets as fast as can be"));
  if (auto ok = measure_ceiling(bus, *lab, o, out); !ok) return tl::unexpected(ok.error());

  progress(concat("make ", o.sets, " volumes"));
  Submit order;
  order.captures = {"bench"};
  order.processing.rig_id = fingerprint(lab->rig);
  order.processing.recipe = o.recipe;
  order.processing.grid = lab->grid;
  const Stopwatch watch;
  if (auto ok = client->ask(order, kPatience); !ok) return tl::unexpected(ok.error());
  std::vector<std::jthread> working;
  for (int i = 0; i < o.workers; ++i) {
    working.emplace_back([&, i](std::stop_token end) {
      Worker worker(bus, {.name = concat("bench-", i), .data_dir = o.data_dir, .threads = o.threads},
                    make_reconstruct_step({o.data_dir, o.threads}));
      (void)worker.run(end);
    });
  }
  if (auto ok = wait_done(*client, stop, out.failed); !ok) return tl::unexpected(ok.error());
  out.volumes_per_s = o.sets / watch.wall_s();
  out.cpu_s_per_volume = watch.cpu_s() / o.sets;
  if (auto ok = read_timings(o, out); !ok) return tl::unexpected(ok.error());
  return out;
}

}  // namespace flamefield
