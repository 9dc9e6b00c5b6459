#include "services/ledger/schema.h"

#include <SQLiteCpp/Database.h>
#include <SQLiteCpp/Transaction.h>

#include <array>
#include <string>

namespace flamefield {

namespace {

// Entry i leads from user_version i to i + 1. Entries are never changed, only added.
// `record` columns hold the exact protobuf message; the other columns are for questions.
constexpr std::array kMigrations = {
    R"sql(
CREATE TABLE captures(
  id TEXT PRIMARY KEY,
  kind TEXT NOT NULL CHECK(kind IN ('dark', 'background', 'flat', 'board', 'burst', 'live')),
  started_time_ns INTEGER NOT NULL,
  finished_time_ns INTEGER NOT NULL DEFAULT 0,     -- 0: still running
  pulses INTEGER NOT NULL DEFAULT 0,               -- trigger pulses that the array saw
  cameras TEXT NOT NULL DEFAULT ''                 -- names, joined by blanks
) STRICT;

CREATE TABLE sets(
  id INTEGER PRIMARY KEY,
  capture TEXT NOT NULL REFERENCES captures(id),
  idx INTEGER NOT NULL CHECK(idx >= 0),            -- number in the capture, from 0
  pulse INTEGER NOT NULL,
  pulse_time_ns INTEGER NOT NULL,
  complete_time_ns INTEGER NOT NULL,
  stored_time_ns INTEGER NOT NULL,
  segment INTEGER NOT NULL,                        -- where it lies in the spool
  byte_offset INTEGER NOT NULL,
  byte_length INTEGER NOT NULL,
  frames INTEGER NOT NULL,
  losses INTEGER NOT NULL,
  UNIQUE(capture, idx)
) STRICT;
CREATE INDEX sets_by_place ON sets(segment, byte_offset);

CREATE TABLE frames(                               -- one row per camera and set: a frame or a named loss
  set_id INTEGER NOT NULL REFERENCES sets(id),
  camera TEXT NOT NULL,
  loss TEXT CHECK(loss IN ('missed', 'incomplete', 'late', 'duplicate', 'camera-lost', 'no-buffer')),
  PRIMARY KEY(set_id, camera)
) STRICT, WITHOUT ROWID;

CREATE TABLE rigs(
  id TEXT PRIMARY KEY,                             -- fingerprint of the geometry
  stored_time_ns INTEGER NOT NULL,
  cameras INTEGER NOT NULL,
  rms_px REAL,                                     -- NULL: not from a calibration
  record BLOB NOT NULL
) STRICT;

CREATE TABLE recipes(
  id TEXT PRIMARY KEY,                             -- fingerprint
  solver TEXT NOT NULL,
  settings TEXT NOT NULL                           -- "table.key=value", one a line
) STRICT;

CREATE TABLE live_plan(only_one INTEGER PRIMARY KEY CHECK(only_one = 1), record BLOB NOT NULL) STRICT;

CREATE TABLE jobs(
  id INTEGER PRIMARY KEY,
  run_id TEXT NOT NULL,
  inputs_hash TEXT NOT NULL,
  recipe_hash TEXT NOT NULL,                       -- recipe and grid
  rig_id TEXT NOT NULL REFERENCES rigs(id),
  program_version TEXT NOT NULL,
  recipe_id TEXT NOT NULL REFERENCES recipes(id),
  priority INTEGER NOT NULL,                       -- larger first
  state TEXT NOT NULL CHECK(state IN ('queued', 'leased', 'done', 'failed')),
  attempt INTEGER NOT NULL DEFAULT 0,
  lease_token INTEGER NOT NULL DEFAULT 0,          -- grows over all jobs, is never given twice
  lease_deadline_ns INTEGER NOT NULL DEFAULT 0,
  not_before_ns INTEGER NOT NULL DEFAULT 0,        -- back-off after a failure
  worker TEXT NOT NULL DEFAULT '',
  reason TEXT NOT NULL DEFAULT '',                 -- of the last failure
  created_time_ns INTEGER NOT NULL,
  leased_time_ns INTEGER NOT NULL DEFAULT 0,
  record BLOB NOT NULL
) STRICT;
CREATE UNIQUE INDEX jobs_identity ON jobs(inputs_hash, recipe_hash, rig_id, program_version) WHERE state <> 'failed';
CREATE INDEX jobs_in_line ON jobs(state, priority DESC, id);
CREATE INDEX jobs_by_token ON jobs(lease_token);

CREATE TABLE job_inputs(
  job_id INTEGER NOT NULL REFERENCES jobs(id),
  set_id INTEGER NOT NULL REFERENCES sets(id),
  PRIMARY KEY(job_id, set_id)
) STRICT, WITHOUT ROWID;
CREATE INDEX job_inputs_by_set ON job_inputs(set_id);

CREATE TABLE runs(
  id TEXT PRIMARY KEY,
  job_id INTEGER NOT NULL UNIQUE REFERENCES jobs(id),
  inputs_hash TEXT NOT NULL,
  recipe_hash TEXT NOT NULL,
  rig_id TEXT NOT NULL REFERENCES rigs(id),
  program_version TEXT NOT NULL,
  capture TEXT NOT NULL,                           -- of the first input
  first_idx INTEGER NOT NULL,
  inputs INTEGER NOT NULL,
  solver TEXT NOT NULL,
  worker TEXT NOT NULL,
  volume_path TEXT NOT NULL,
  volume_bytes INTEGER NOT NULL,
  volume_fingerprint TEXT NOT NULL,
  iterations INTEGER NOT NULL,
  residual REAL NOT NULL,
  started_time_ns INTEGER NOT NULL,
  finished_time_ns INTEGER NOT NULL,
  committed_time_ns INTEGER NOT NULL,
  queue_s REAL NOT NULL,
  fetch_s REAL NOT NULL,
  prepare_s REAL NOT NULL,
  solve_s REAL NOT NULL,
  write_s REAL NOT NULL,
  record BLOB NOT NULL,
  UNIQUE(inputs_hash, recipe_hash, rig_id, program_version)
) STRICT;
CREATE INDEX runs_by_capture ON runs(capture, first_idx);

CREATE TABLE run_metrics(
  run_id TEXT NOT NULL REFERENCES runs(id),
  name TEXT NOT NULL,
  value REAL NOT NULL,
  PRIMARY KEY(run_id, name)
) STRICT, WITHOUT ROWID;

CREATE TABLE events(
  id INTEGER PRIMARY KEY,
  time_ns INTEGER NOT NULL,
  kind TEXT NOT NULL,
  subject TEXT NOT NULL,
  text TEXT NOT NULL
) STRICT;
)sql",
    // The line of work: three priorities, shares, pauses, crashes, and what runs take.
    R"sql(
UPDATE jobs SET priority = priority + 1;           -- scheduled 0, interactive 1, live 2
ALTER TABLE jobs ADD COLUMN share TEXT NOT NULL DEFAULT '';           -- submitter, or capture of the first input
ALTER TABLE jobs ADD COLUMN submitter TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN submission INTEGER NOT NULL DEFAULT 0;    -- asked for together
ALTER TABLE jobs ADD COLUMN work REAL NOT NULL DEFAULT 0;             -- voxels x views
ALTER TABLE jobs ADD COLUMN paused INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN cancelled INTEGER NOT NULL DEFAULT 0;     -- failed because somebody said so
ALTER TABLE jobs ADD COLUMN crashes INTEGER NOT NULL DEFAULT 0;       -- workers' processes that died of it
ALTER TABLE jobs ADD COLUMN tied_to TEXT NOT NULL DEFAULT '';         -- the worker that died
ALTER TABLE jobs ADD COLUMN in_process INTEGER NOT NULL DEFAULT 0;    -- leased to a thread of the dispatcher's process
UPDATE jobs SET share = coalesce((SELECT s.capture FROM job_inputs i JOIN sets s ON s.id = i.set_id
  WHERE i.job_id = jobs.id LIMIT 1), '');
DROP INDEX jobs_in_line;
CREATE INDEX jobs_by_state ON jobs(state, id);
CREATE INDEX jobs_by_submission ON jobs(submission);

CREATE TABLE control(only_one INTEGER PRIMARY KEY CHECK(only_one = 1), paused INTEGER NOT NULL) STRICT;

ALTER TABLE runs ADD COLUMN work REAL NOT NULL DEFAULT 0;
ALTER TABLE runs ADD COLUMN peak_rss_mib REAL NOT NULL DEFAULT 0;
ALTER TABLE runs ADD COLUMN estimated_s REAL NOT NULL DEFAULT 0;      -- 0: unknown
ALTER TABLE runs ADD COLUMN estimated_mib REAL NOT NULL DEFAULT 0;
CREATE INDEX runs_newest ON runs(committed_time_ns);
CREATE INDEX runs_newest_of_capture ON runs(capture, committed_time_ns);
CREATE INDEX runs_newest_of_rig ON runs(rig_id, committed_time_ns);
CREATE INDEX runs_newest_of_solver ON runs(solver, committed_time_ns);

CREATE TABLE totals(what TEXT PRIMARY KEY, n INTEGER NOT NULL) STRICT, WITHOUT ROWID;  -- counting rows takes long
INSERT INTO totals SELECT 'sets', count(*) FROM sets;
INSERT INTO totals SELECT 'runs', count(*) FROM runs;
INSERT INTO totals SELECT s.value, (SELECT count(*) FROM jobs WHERE state = s.value)
  FROM (SELECT 'queued' AS value UNION SELECT 'leased' UNION SELECT 'done' UNION SELECT 'failed') s;
CREATE TRIGGER count_sets_in AFTER INSERT ON sets BEGIN UPDATE totals SET n = n + 1 WHERE what = 'sets'; END;
CREATE TRIGGER count_sets_out AFTER DELETE ON sets BEGIN UPDATE totals SET n = n - 1 WHERE what = 'sets'; END;
CREATE TRIGGER count_runs_in AFTER INSERT ON runs BEGIN UPDATE totals SET n = n + 1 WHERE what = 'runs'; END;
CREATE TRIGGER count_runs_out AFTER DELETE ON runs BEGIN UPDATE totals SET n = n - 1 WHERE what = 'runs'; END;
CREATE TRIGGER count_jobs_in AFTER INSERT ON jobs BEGIN UPDATE totals SET n = n + 1 WHERE what = new.state; END;
CREATE TRIGGER count_jobs_out AFTER DELETE ON jobs BEGIN UPDATE totals SET n = n - 1 WHERE what = old.state; END;
CREATE TRIGGER count_jobs_moved AFTER UPDATE OF state ON jobs WHEN old.state <> new.state BEGIN
  UPDATE totals SET n = n - 1 WHERE what = old.state;
  UPDATE totals SET n = n + 1 WHERE what = new.state;
END;
)sql",
    // Sets with a corrupt frame were refused; captures say how they ended,
    // and what the array counted of each camera.
    R"sql(
CREATE TABLE frames_2(                             -- one row per camera and set: a frame or a named loss
  set_id INTEGER NOT NULL REFERENCES sets(id),
  camera TEXT NOT NULL,
  loss TEXT CHECK(loss IN ('missed', 'incomplete', 'late', 'duplicate', 'camera-lost', 'no-buffer', 'corrupt')),
  PRIMARY KEY(set_id, camera)
) STRICT, WITHOUT ROWID;
INSERT INTO frames_2 SELECT set_id, camera, loss FROM frames;
DROP TABLE frames;
ALTER TABLE frames_2 RENAME TO frames;

ALTER TABLE captures ADD COLUMN pulses_wanted INTEGER NOT NULL DEFAULT 0;  -- 0: until stopped
ALTER TABLE captures ADD COLUMN pre_pulses INTEGER NOT NULL DEFAULT 0;     -- of the pulses: before the request
ALTER TABLE captures ADD COLUMN ending TEXT NOT NULL DEFAULT 'none'
  CHECK(ending IN ('none', 'complete', 'stopped', 'storage', 'interrupted'));
ALTER TABLE captures ADD COLUMN end_reason TEXT NOT NULL DEFAULT '';
ALTER TABLE captures ADD COLUMN settings TEXT NOT NULL DEFAULT '';         -- of the cameras, "name=value", one a line
CREATE TABLE capture_counters(                     -- frames-in, delivered, late, duplicate, extra, count-slip, ...
  capture TEXT NOT NULL REFERENCES captures(id),
  camera TEXT NOT NULL,
  name TEXT NOT NULL,
  value INTEGER NOT NULL,
  PRIMARY KEY(capture, camera, name)
) STRICT, WITHOUT ROWID;
)sql",
    // The table of runs.
    R"sql(
-- All that a page of the table of runs shows, newest first: read without touching the records.
CREATE INDEX runs_listed ON runs(finished_time_ns, id, capture, first_idx, inputs, solver, worker, rig_id, iterations,
  residual, volume_bytes, started_time_ns);
)sql",
    // Calibrations that someone accepted, one after the other.
    R"sql(
CREATE TABLE calibrations(
  version INTEGER PRIMARY KEY CHECK(version > 0),  -- 1, 2, ...
  predecessor INTEGER REFERENCES calibrations(version),
  rig_id TEXT NOT NULL REFERENCES rigs(id),
  accepted_time_ns INTEGER NOT NULL,
  accepted_by TEXT NOT NULL,
  note TEXT NOT NULL,
  volume_mean_px REAL NOT NULL,                    -- error in the measuring volume, as foreseen
  volume_worst_px REAL NOT NULL,
  verdict TEXT NOT NULL,
  record BLOB NOT NULL
) STRICT;
)sql",
    // Upkeep: files, tags, calibrations, schedules.
    R"sql(
CREATE TABLE artefacts(                            -- files that runs left, relative to the data directory
  path TEXT PRIMARY KEY,
  run_id TEXT NOT NULL,
  kind TEXT NOT NULL CHECK(kind IN ('volume', 'projections')),
  bytes INTEGER NOT NULL,
  sha256 TEXT NOT NULL,                            -- empty: made before checksums were kept
  retired_time_ns INTEGER NOT NULL DEFAULT 0       -- removed by retention, can be made again; 0: there
) STRICT;
CREATE INDEX artefacts_by_run ON artefacts(run_id);
INSERT OR IGNORE INTO artefacts(path, run_id, kind, bytes, sha256)
  SELECT volume_path, id, 'volume', volume_bytes, '' FROM runs;

CREATE TABLE tags(
  subject TEXT NOT NULL,                           -- a run or a capture
  tag TEXT NOT NULL,
  PRIMARY KEY(subject, tag)
) STRICT, WITHOUT ROWID;

CREATE TABLE accepted_rigs(                        -- which calibration counts, and for what
  accepted_time_ns INTEGER NOT NULL,
  rig_id TEXT NOT NULL REFERENCES rigs(id),
  since_ns INTEGER NOT NULL,                       -- for sets of pulses from here on
  PRIMARY KEY(accepted_time_ns, rig_id)
) STRICT, WITHOUT ROWID;

CREATE TABLE schedules(
  name TEXT PRIMARY KEY,
  cron TEXT NOT NULL,
  zone TEXT NOT NULL,
  created_time_ns INTEGER NOT NULL,
  last_due_ns INTEGER NOT NULL,                    -- everything up to here was dealt with
  record BLOB NOT NULL
) STRICT;

CREATE TABLE schedule_runs(                        -- what became of each due time
  id INTEGER PRIMARY KEY,
  schedule TEXT NOT NULL,
  due_ns INTEGER NOT NULL,
  time_ns INTEGER NOT NULL,
  outcome TEXT NOT NULL,
  text TEXT NOT NULL,
  jobs INTEGER NOT NULL
) STRICT;

CREATE TABLE schedule_jobs(
  schedule TEXT NOT NULL,
  job_id INTEGER NOT NULL REFERENCES jobs(id),
  PRIMARY KEY(schedule, job_id)
) STRICT, WITHOUT ROWID;

CREATE INDEX jobs_by_run ON jobs(run_id);
CREATE INDEX sets_by_time ON sets(pulse_time_ns);
-- All that filters ask most often: they read these instead of tables whose rows hold whole records.
DROP INDEX runs_newest;
CREATE INDEX runs_filtered ON runs(committed_time_ns, job_id, id, capture, first_idx, inputs, solver, rig_id,
  program_version, worker, iterations, residual, finished_time_ns, solve_s, queue_s);
CREATE INDEX sets_listed ON sets(capture, idx, pulse_time_ns, pulse, frames, losses);
CREATE INDEX tags_by_tag ON tags(tag, subject);
)sql"};

}  // namespace

int newest_schema_version() {
  return static_cast<int>(kMigrations.size());
}

bool migrate(SQLite::Database& database) {
  return migrate(database, newest_schema_version());
}

bool migrate(SQLite::Database& database, int wanted) {
  int version = database.execAndGet("PRAGMA user_version").getInt();
  if (version > wanted) return false;
  for (; version < wanted; ++version) {
    SQLite::Transaction transaction(database, SQLite::TransactionBehavior::IMMEDIATE);
    database.exec(kMigrations[static_cast<std::size_t>(version)]);
    database.exec("PRAGMA user_version = " + std::to_string(version + 1));
    transaction.commit();
  }
  return true;
}

}  // namespace flamefield
