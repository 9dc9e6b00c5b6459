#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "proto/calibration.h"
#include "proto/capture.h"
#include "proto/error.h"
#include "proto/frame.h"
#include "proto/job.h"
#include "proto/rig.h"
#include "proto/upkeep.h"

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
  std::int64_t pulses = 0;            // trigger pulses that the array saw, those before the request included
  std::vector<std::string> cameras = {};
  std::int64_t pulses_wanted = 0;  // 0: until stopped
  std::int64_t pre_pulses = 0;     // of the pulses: from before the request
  CaptureEnd end = CaptureEnd::None;
  std::string end_reason = {};  // in words, where there is more to say
  std::vector<CameraAccount> accounts = {};
  // What the cameras were set to and read back, e.g. exposure_us=350; names without '=', no line breaks.
  std::map<std::string, std::string> settings = {};
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
  Priority priority = Priority::Interactive;
  std::string submitter = {};  // for a fair share between several; empty: the capture's name
};
struct Submitted {
  std::vector<std::int64_t> job_ids;
  std::vector<std::string> run_ids;  // of all that was asked for, also of what is already there
  std::int64_t identical = 0;        // already done or waiting: not done twice
  std::int64_t submission = 0;       // names these jobs together
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
    std::string host = {};
    std::int64_t threads = 0, cores = 0, memory_mib = 0;  // 0: not told
  };
  struct Waiting {
    std::int64_t job_id = 0;
    std::string why;
  };
  std::string program_version;
  std::int64_t sets = 0, runs = 0;
  std::int64_t queued = 0, leased = 0, done = 0, failed = 0;  // jobs
  std::map<std::string, std::int64_t> queued_by_priority;
  bool paused = false;  // everything waits
  std::vector<Worker> workers;
  std::vector<Waiting> waiting;                  // the next ones in line
  std::map<std::string, std::int64_t> counters;  // e.g. leases_expired, stale_commits_refused
};

struct ControlJobs {  // -> JobsControlled
  JobAction action = JobAction::Pause;
  std::vector<std::int64_t> jobs = {};  // these,
  std::int64_t submission = 0;          // those of one Submit,
  bool all = false;                     // or everything; Pause then holds later jobs too
};
struct JobsControlled {
  std::int64_t changed = 0;
  std::int64_t unchanged = 0;  // e.g. already done, or asked for again since
};
struct GetJobs {  // -> Jobs
  std::optional<JobState> state = {};
  std::int64_t submission = 0;  // 0: all
  std::int64_t limit = 100;     // newest first when it cuts
};
struct Jobs {
  struct Row {
    std::int64_t id = 0;
    std::string run_id;
    JobState state = JobState::Queued;
    Priority priority = Priority::Interactive;
    std::string submitter;
    std::int64_t submission = 0;
    int attempt = 0;
    std::string worker;
    std::int64_t created_time_ns = 0;
    std::string why;  // it waits, or failed
  };
  std::vector<Row> rows;
};

// --- workers -> dispatcher -> reply

struct Ready {  // -> Lease when there is work: one Ready is one credit
  std::string worker;
  std::string program_version;
  std::int64_t threads = 0;
  std::string host = {};  // jobs are matched to what the worker's machine has; 0: not told, may do all
  std::int64_t cores = 0, memory_mib = 0;
  std::string data_id = {};  // of its volumes directory, which must be the dispatcher's; empty: not told
  bool live_only = false;    // takes live work alone
  bool own_memory = false;   // memory_mib is its own, not shared with the host's other workers
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
  bool crashed = false;  // the worker's process died of it; told by its successor
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

using Message =
    std::variant<PutSet, SetStored, PutCapture, PutRig, RigStored, LivePlan, Submit, Submitted, PutMetrics,
                 GetStatus, Status, Ready, Lease, FetchSet, SetData, Heartbeat, LeaseLost, Finish, Committed,
                 Fail, Accepted, Rejected, Event, StartCapture, StopCapture, GetCapture, GetPreview,
                 CaptureState, ControlJobs, JobsControlled, GetJobs, Jobs, StandBy, StartCalibration,
                 TakePose, SolveCalibration, AcceptCalibration, DiscardCalibration, GetCalibration,
                 CalibrationState, PutCalibration, CalibrationStored, PutTags, AcceptRig, PutSchedule,
                 DropSchedule, ScheduleRan, Retire>;

struct Envelope {
  std::uint64_t request = 0;  // 0: no reply expected
  Message message;
};

}  // namespace flamefield
