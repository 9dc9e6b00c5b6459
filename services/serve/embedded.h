#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "services/acquisition/acquisition.h"
#include "services/bus/bus.h"
#include "services/calibration/service.h"

namespace flamefield {

struct EmbeddedOptions {
  std::filesystem::path data_dir;
  // Cameras, their settings and what surrounds a capture. No cameras: no acquisition.
  AcquisitionOptions acquisition;
  // What calibration sessions assume; cameras, data folder and inner endpoints are filled in.
  CalibrationServiceOptions calibration;
  std::vector<std::string> dispatcher_endpoints = {"inproc://dispatcher"};
  std::vector<std::string> event_endpoints = {"inproc://events"};
  int workers = 0;                      // 0: one a core, which beats one worker with many threads
  int threads_per_worker = 0;           // 0: the cores, shared out
  std::string http_host = "127.0.0.1";  // a loopback address
  int http_port = 8080;                 // 0: any free one, negative: no page
  std::string http_public_name;         // of a reverse proxy in front; empty: none
  std::filesystem::path report;         // linked from the live page; empty: none
};

// Every service in one process, each in a thread of its own, talking over the same bus as separate processes
// would. Recording goes first: reconstruction runs at a lower priority than everything else.
class Embedded {
 public:
  // Starts all. Unavailable: a camera does not answer, a port or an endpoint is in use, the ledger is locked.
  static Result<std::unique_ptr<Embedded>> start(Bus& bus, const EmbeddedOptions& options);

  // Stops in the order of the data's way: cameras, storing, work, page. What was captured is stored first.
  ~Embedded();

  // Fingerprint of the rig that the last accepted session found; empty: none was accepted since the start.
  std::string accepted_rig() const;
  const std::string& page_url() const;  // empty: no page

  // The first service that failed since the start; none while all is well.
  std::optional<Error> failed() const;

 private:
  struct Impl;
  explicit Embedded(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace flamefield
