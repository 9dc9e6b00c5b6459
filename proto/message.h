#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "proto/capture.h"
#include "proto/error.h"
#include "proto/frame.h"
#include "proto/job.h"
#include "proto/rig.h"

// What travels on the bus. A request carries a number that its reply repeats; the pixels of a frame set
// follow the header as raw message parts, one per frame in the set's order.
namespace flamefield {

// --- producers and clients -> dispatcher -> reply

struct PutSet {  // -> SetStored, once it is on disk; sending the same set again is harmless
  FrameSet set;
};
struct SetStored {
  SetId id;
  bool already_there = false;
};
struct PutCapture {  // -> Accepted; starts a capture, and again when it ends, with what the array counted
  std::string id;
  CaptureKind kind = CaptureKind::Burst;
  std::int64_t started_time_ns = 0;
  std::int64_t finished_time_ns = 0;  // 0: still running
  std::int64_t pulses = 0;            // trigger pulses that the array saw
  std::vector<std::string> cameras;
};
struct PutRig {  // -> RigStored
  Rig rig;
};
struct RigStored {
  std::string rig_id;
};
struct LivePlan {  // -> Accepted; while on, each stored burst or live set becomes a job
  bool on = false;
  Processing processing;
};
struct Submit {                       // -> Submitted
  std::vector<std::string> captures;  // all their sets,
  std::vector<SetId> sets;            // and these
  Combine combine = Combine::Each;
  Processing processing;
  Priority priority = Priority::Batch;
};
struct Submitted {
  std::vector<std::int64_t> job_ids;
  std::vector<std::string> run_ids;  // of all that was asked for, also of what is already there
  std::int64_t identical = 0;        // already done or waiting: not done twice
};
struct PutMetrics {  // -> Accepted; what was found out about a run later, e.g. against a known truth
  std::string run_id;
  std::map<std::string, double> metrics;
};
struct GetStatus {};  // -> Status
struct Status {
  struct Worker {
    std::string name;
    std::int64_t job_id = 0;  // 0: idle
    double silent_s = 0;
  };
  struct Waiting {
    std::int64_t job_id = 0;
    std::string why;
  };
  std::string program_version;
  std::int64_t sets = 0, runs = 0;
  std::int64_t queued = 0, leased = 0, done = 0, failed = 0;  // jobs
  std::vector<Worker> workers;
  std::vector<Waiting> waiting;                  // the next ones in line
  std::map<std::string, std::int64_t> counters;  // e.g. leases_expired, stale_commits_refused
};

// --- workers -> dispatcher -> reply

struct Ready {  // -> Lease when there is work: one Ready is one credit
  std::string worker;
  std::string program_version;
  std::int64_t threads = 0;
};
struct FetchSet {  // -> SetData
  SetId id;
};
struct SetData {
  FrameSet set;
};
struct Heartbeat {  // -> LeaseLost when the token no longer counts, else nothing
  Progress progress;
};
struct LeaseLost {
  std::int64_t token = 0;
};
struct Finish {  // -> Committed, or Rejected when the token is stale
  std::int64_t token = 0;
  Run run;
};
struct Committed {
  std::string run_id;
};
struct Fail {  // -> Accepted; Unavailable errors are tried again later
  std::int64_t token = 0;
  Error error;
};

// --- replies to anything

struct Accepted {};
struct Rejected {
  Error error;
};

// --- published, single part, may be dropped

struct Event {
  std::int64_t time_ns = 0;  // UTC
  std::string kind;          // set-stored, job-leased, run-committed, job-failed, lease-expired, ...
  std::string subject;       // a capture, run or worker
  std::string text;
};

using Message = std::variant<PutSet, SetStored, PutCapture, PutRig, RigStored, LivePlan, Submit, Submitted,
                             PutMetrics, GetStatus, Status, Ready, Lease, FetchSet, SetData, Heartbeat,
                             LeaseLost, Finish, Committed, Fail, Accepted, Rejected, Event, StartCapture,
                             StopCapture, GetCapture, GetPreview, CaptureState>;

struct Envelope {
  std::uint64_t request = 0;  // 0: no reply expected
  Message message;
};

}  // namespace flamefield
