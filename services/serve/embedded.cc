#include "services/serve/embedded.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <mutex>
#include <optional>
#include <thread>

#include "services/api/pages.h"
#include "services/dispatcher/dispatcher.h"
#include "services/log/log.h"
#include "services/serve/reprocessing.h"
#include "services/worker/reconstruct_job.h"
#include "services/worker/worker.h"

namespace flamefield {

namespace {

// Recording must not wait for arithmetic: this thread, and those it starts, yield to all others.
void lower_priority() {
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), 10);
}

int cores() {
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

int threads_for_each(int workers, int threads_per_worker) {
  return threads_per_worker > 0 ? threads_per_worker : std::max(1, cores() / workers);
}

}  // namespace

struct Embedded::Impl {
  std::unique_ptr<Dispatcher> dispatcher;
  std::unique_ptr<Acquisition> acquisition;
  std::unique_ptr<CalibrationService> calibration;
  std::vector<std::unique_ptr<Worker>> workers;
  std::unique_ptr<Pages> pages;
  std::string page_url;

  std::mutex mutex;
  std::optional<Error> failed;

  // In the order in which they may stop; each member's thread ends before the ones above it.
  std::jthread dispatcher_thread, acquisition_thread, calibration_thread;
  std::vector<std::jthread> worker_threads;
  std::jthread gateway_thread, scheduler_thread;

  void note(const std::string& service, const Result<>& result) {
    if (result) return;
    log_event(LogLevel::Error, "service-failed", {{"service", service}, {"error", result.error().message}});
    const std::scoped_lock lock(mutex);
    if (!failed) failed = result.error();
  }
};

Result<std::unique_ptr<Embedded>> Embedded::start(Bus& bus, const EmbeddedOptions& options) {
  auto impl = std::make_unique<Impl>();
  Impl& s = *impl;

  // First everything that can be refused, then the threads.
  DispatcherOptions dispatcher;
  dispatcher.data_dir = options.data_dir;
  dispatcher.endpoints = options.dispatcher_endpoints;
  dispatcher.event_endpoints = options.event_endpoints;
  auto opened = Dispatcher::open(bus, dispatcher);
  if (!opened) return tl::unexpected(opened.error());
  s.dispatcher = std::move(*opened);
  if (options.http_port >= 0) {
    HttpServerOptions http;
    http.address = options.http_host;
    http.port = static_cast<std::uint16_t>(options.http_port);
    http.public_name = options.http_public_name;
    auto pages = Pages::open(
        bus, http,
        {.role = "operator",
         .acquisition = options.acquisition.endpoints.front(),
         .dispatcher = options.dispatcher_endpoints.front(),
         .data_dir = options.data_dir,
         .calibration = options.acquisition.cameras.empty() ? "" : options.calibration.endpoints.front()},
        options.report);
    if (!pages) return tl::unexpected(pages.error());
    s.pages = std::move(*pages);
    s.page_url = s.pages->url();
  }
  if (!options.acquisition.cameras.empty()) {
    auto acquisition = Acquisition::open(bus, options.acquisition);
    if (!acquisition) return tl::unexpected(acquisition.error());
    s.acquisition = std::move(*acquisition);
    CalibrationServiceOptions calibration = options.calibration;
    for (const CameraAddress& camera : options.acquisition.cameras)
      calibration.cameras.push_back(camera.name);
    calibration.data_dir = options.data_dir;
    calibration.acquisition_endpoint = options.acquisition.endpoints.front();
    calibration.dispatcher_endpoint = options.dispatcher_endpoints.front();
    auto sessions = CalibrationService::open(bus, calibration);
    if (!sessions) return tl::unexpected(sessions.error());
    s.calibration = std::move(*sessions);
  }

  s.dispatcher_thread =
      std::jthread([&s](std::stop_token stop) { s.note("dispatcher", s.dispatcher->run(stop)); });
  if (s.acquisition) {
    s.acquisition_thread =
        std::jthread([&s](std::stop_token stop) { s.note("acquisition", s.acquisition->run(stop)); });
    s.calibration_thread = std::jthread([&s](std::stop_token stop) {
      lower_priority();
      s.note("calibration", s.calibration->run(stop));
    });
  }
  const int workers = options.workers > 0 ? options.workers : cores();
  for (int i = 0; i < workers; ++i) {
    WorkerOptions worker;
    worker.endpoint = options.dispatcher_endpoints.front();
    worker.data_dir = options.data_dir;
    worker.threads = threads_for_each(workers, options.threads_per_worker);
    s.workers.push_back(
        std::make_unique<Worker>(bus, worker, make_reconstruct_step({options.data_dir, worker.threads})));
    s.worker_threads.emplace_back([&s, w = s.workers.back().get()](std::stop_token stop) {
      lower_priority();
      s.note("worker", w->run(stop));
    });
  }
  s.scheduler_thread = std::jthread(
      [&s, scheduler = make_scheduler(bus, options.dispatcher_endpoints.front(), options.data_dir)](
          std::stop_token stop) mutable { s.note("scheduler", scheduler.run(stop)); });
  if (s.pages) {
    s.gateway_thread = std::jthread([&s](std::stop_token stop) {
      lower_priority();
      s.pages->run(stop);
    });
  }
  return std::unique_ptr<Embedded>(new Embedded(std::move(impl)));
}

Embedded::Embedded(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Embedded::~Embedded() {
  const auto end = [](std::jthread& thread) {
    thread.request_stop();
    if (thread.joinable()) thread.join();
  };
  end(impl_->calibration_thread);  // gives the cameras back
  end(impl_->acquisition_thread);  // drains into the dispatcher
  for (auto& worker : impl_->worker_threads) worker.request_stop();
  for (auto& worker : impl_->worker_threads) end(worker);
  end(impl_->gateway_thread);
  end(impl_->scheduler_thread);
  end(impl_->dispatcher_thread);
}

std::string Embedded::accepted_rig() const {
  return impl_->calibration ? impl_->calibration->accepted_rig() : "";
}

const std::string& Embedded::page_url() const {
  return impl_->page_url;
}

std::optional<Error> Embedded::failed() const {
  const std::scoped_lock lock(impl_->mutex);
  return impl_->failed;
}

}  // namespace flamefield
