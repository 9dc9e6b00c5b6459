// What is asked of Slurm, and what is read of its answers; no Slurm is needed.
#include <gtest/gtest.h>

#include <algorithm>

#include "services/cluster/cluster.h"
#include "services/process/run_program.h"
#include "tests/support/scratch.h"

namespace flamefield {
namespace {

using namespace std::chrono_literals;

TEST(PilotSize, FollowsTheEstimateWithinTheConfigurationsLimits) {
  ClusterConfig config;
  config.pilots = 8;
  config.drain_s = 120;
  config.idle_s = 60;
  const PilotSize size = size_pilots({.volumes = 1000, .seconds = 80'000, .peak_rss_mib = 2000}, config);
  EXPECT_EQ(size.pilots, 8);
  EXPECT_EQ(size.memory_mib, 2756);  // 1.25 x 2000 + 256
  EXPECT_EQ(size.minutes, 253);      // (1.5 x 10,000 s + 180 s) / 60
  EXPECT_EQ(size.seconds_left, 0);
  config.most_minutes = 60;
  const PilotSize cut = size_pilots({.volumes = 1000, .seconds = 80'000, .peak_rss_mib = 2000}, config);
  EXPECT_EQ(cut.minutes, 60);
  EXPECT_EQ(cut.seconds_left, 80'000 - 8 * (3600 - 120));
}

TEST(PilotSize, HiresNoMoreThanTheWorkPaysFor) {
  const ClusterConfig config;
  EXPECT_EQ(size_pilots({.volumes = 3, .seconds = 100'000}, config).pilots, 3);
  EXPECT_EQ(size_pilots({.volumes = 1000, .seconds = 90}, config).pilots, 2);
  EXPECT_EQ(size_pilots({.volumes = 1000}, config).pilots, config.pilots) << "nothing is known of the work";
  EXPECT_GT(size_pilots({.volumes = 1}, config).minutes, 30);
}

TEST(PilotSize, LeavesToTheConfigurationWhatItNames) {
  ClusterConfig config;
  config.memory_mib = 777;
  config.minutes = 9;
  config.cores = 5;
  const PilotSize size = size_pilots({.volumes = 10, .seconds = 1e6, .peak_rss_mib = 9000}, config);
  EXPECT_EQ(size.memory_mib, 777);
  EXPECT_EQ(size.minutes, 9);
  EXPECT_EQ(size.cores, 5);
}

TEST(Sbatch, GetsEveryWordAsOneArgumentAndNoEnvironment) {
  PilotArray array;
  array.name = "flamefield-x";
  array.directory = "/shared/pilots/flamefield-x";
  array.script = "/shared/my pilots/pilot.sh";
  array.arguments = {"a b", "$(rm)"};
  array.pilots = 3;
  array.partition = "night";
  array.sbatch = {"--qos=low"};
  const auto words = sbatch_command(array);
  const auto has = [&](const std::string& word) { return std::ranges::find(words, word) != words.end(); };
  EXPECT_EQ(words[0], "sbatch");
  for (const char* word : {"--array=1-3", "--partition=night", "--qos=low", "--export=NIL",
                           "--signal=B:USR1@120", "/shared/my pilots/pilot.sh", "a b", "$(rm)"})
    EXPECT_TRUE(has(word)) << word;
  for (const std::string& word : words)
    EXPECT_FALSE(word.starts_with("--time") || word.starts_with("--account"));
}

TEST(Squeue, IsReadInItsOlderAndItsNewerForm) {
  const auto old =
      read_squeue(R"({"jobs":[{"job_id":8,"array_job_id":1,"array_task_id":2,"name":"flamefield-x",
      "job_state":"RUNNING","state_reason":"None","state_description":"","nodes":"w2","partition":"flame",
      "time_limit":60,"start_time":1795391164}]})");
  const auto newer =
      read_squeue(R"({"jobs":[{"job_id":8,"array_job_id":{"set":true,"infinite":false,"number":1},
      "array_task_id":{"set":true,"infinite":false,"number":2},"name":"flamefield-x","job_state":["RUNNING"],
      "state_reason":"None","nodes":"w2","partition":"flame","time_limit":{"set":true,"infinite":false,"number":60},
      "start_time":{"set":true,"infinite":false,"number":1795391164}}]})");
  for (const auto& jobs : {old, newer}) {
    ASSERT_TRUE(jobs) << jobs.error().message;
    ASSERT_EQ(jobs->size(), 1u);
    const SlurmJob& job = jobs->front();
    EXPECT_EQ(job.id, 1);
    EXPECT_EQ(job.task, 2);
    EXPECT_EQ(job.state, "RUNNING");
    EXPECT_EQ(job.time_limit_min, 60);
    EXPECT_TRUE(job.is_alive());
    EXPECT_EQ(explain(job), "");
  }
}

TEST(Squeue, WhatIsNoListOfJobsIsRefused) {
  for (const char* text : {"", "{}", "[]", "{\"jobs\": 3}", "Unable to contact slurm controller"})
    EXPECT_FALSE(read_squeue(text)) << text;
  const auto away = read_squeue(R"({"errors":[{"source":"slurm_load_jobs","error_number":-1}],"jobs":[]})");
  ASSERT_FALSE(away) << "an empty list would say that nobody is left";
  EXPECT_EQ(away.error().code, ErrorCode::Unavailable);
  const auto odd = read_squeue(R"({"jobs":[3, {"job_id":"x","job_state":[],"array_task_id":{}}]})");
  ASSERT_TRUE(odd);
  EXPECT_EQ(odd->size(), 1u);
}

TEST(Squeue, ReasonsAreSaidInWords) {
  SlurmJob job;
  job.state = "PENDING";
  job.reason = "PartitionDown";
  EXPECT_EQ(explain(job), "PartitionDown (the partition is down)");
  job.reason = "SomethingNew";
  EXPECT_EQ(explain(job), "SomethingNew");
  job.description = "Nodes required for job are DOWN";
  EXPECT_EQ(explain(job), "SomethingNew (Nodes required for job are DOWN)");
}

// A controller that lost its state forgets jobs that run on: their key must not go.
TEST(Hired, AreOverWhenNeitherSlurmNorTheDispatcherKnowsOneThatLives) {
  Hired hired;
  hired.name = "flamefield-x-1";
  Status::Worker worker;
  worker.name = "flamefield-x-1-3.2";
  EXPECT_TRUE(is_over(hired, {}));
  EXPECT_FALSE(is_over(hired, {worker}));
  worker.name = "flamefield-x-12-1";
  EXPECT_TRUE(is_over(hired, {worker})) << "others, whose name begins like theirs";
  SlurmJob& job = hired.pilots.emplace_back();
  job.state = "COMPLETING";
  EXPECT_FALSE(is_over(hired, {}));
  job.state = "TIMEOUT";
  EXPECT_TRUE(is_over(hired, {}));
}

TEST(ClusterPlace, WantsAnAddressThatNodesReachAndASharedVolumesDirectory) {
  const Scratch scratch;
  LabConfig lab;
  lab.data_directory = scratch / "data";
  std::filesystem::create_directories(scratch / "data/volumes");
  const auto fault = [&] {
    const auto place = cluster_place(lab);
    return place ? std::string("none") : place.error().message;
  };
  EXPECT_NE(fault().find("[bus] dispatcher"), std::string::npos) << fault();
  for (const char* endpoint : {"ipc:///tmp/x", "tcp://*:7300", "tcp://0.0.0.0:7300"}) {
    lab.dispatcher_endpoint = endpoint;
    EXPECT_NE(fault().find("no node can connect"), std::string::npos) << fault();
  }
  lab.cluster.endpoint = "tcp://10.0.0.1:7300";
  EXPECT_EQ(fault(), "none");
  lab.cluster.directory = scratch / "shared";
  std::filesystem::create_directories(scratch / "shared/volumes");
  EXPECT_NE(fault().find("ln -s"), std::string::npos) << fault();
  std::filesystem::remove(scratch / "data/volumes");
  std::filesystem::create_directory_symlink(scratch / "shared/volumes", scratch / "data/volumes");
  EXPECT_EQ(fault(), "none");
}

TEST(RunProgram, HearsBothStreamsToTheEnd) {
  const auto said =
      run_program({"sh", "-c", "head -c 300000 /dev/zero; head -c 200000 /dev/zero >&2; exit 3"}, 30s);
  ASSERT_TRUE(said) << said.error().message;
  EXPECT_EQ(said->exit_code, 3);
  EXPECT_EQ(said->out.size(), 300'000u);
  EXPECT_EQ(said->err.size(), 200'000u);
}

TEST(RunProgram, NamesWhatIsNotThereAndEndsWhatTakesTooLong) {
  EXPECT_EQ(run_program({"no-such-program"}, 1s).error().code, ErrorCode::NotFound);
  const auto began = std::chrono::steady_clock::now();
  EXPECT_EQ(run_program({"sleep", "60"}, 200ms).error().code, ErrorCode::Unavailable);
  EXPECT_LT(std::chrono::steady_clock::now() - began, 20s);
  EXPECT_EQ(run_program({"sh", "-c", "kill -9 $$"}, 5s)->exit_code, 137);
}

}  // namespace
}  // namespace flamefield
