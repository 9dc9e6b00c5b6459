#include "tests/slurm/slurm_cluster.h"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <fstream>
#include <random>
#include <thread>

#include "services/bus/bus.h"
#include "services/process/run_program.h"
#include "services/store/file.h"

namespace flamefield::testing_support {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

namespace {

std::string path_of(const std::string& program) {
  for (const char* folder : {"/usr/sbin/", "/usr/bin/", "/usr/local/sbin/", "/usr/local/bin/"}) {
    if (fs::exists(folder + program)) return folder + program;
  }
  return {};
}

std::string host() {
  char name[256] = {};
  ::gethostname(name, sizeof name - 1);
  return name;
}

// Four free ports in a row, below those that Linux hands to outgoing connections.
int free_ports() {
  std::random_device random;
  const Scratch keys;
  Bus bus(KeyRing::open_or_create(keys / "keys").value());
  for (int tries = 0; tries < 100; ++tries) {
    const int first = 20'000 + static_cast<int>(random() % 12'000);
    bool free = true;
    for (int i = 0; i < 4; ++i) {
      Router probe(bus);
      free = free && probe.bind(concat("tcp://127.0.0.1:", first + i));
    }
    if (free) return first;
  }
  return 0;
}

// Processes of this machine of which `matches(folder in /proc)` holds.
template <class Matches>
std::vector<int> processes(Matches matches) {
  std::vector<int> found;
  std::error_code problem;
  for (const auto& entry : fs::directory_iterator("/proc", problem)) {
    const std::string name = entry.path().filename().string();
    int pid = 0;
    if (std::from_chars(name.data(), name.data() + name.size(), pid).ec != std::errc()) continue;
    if (pid > 0 && pid != ::getpid() && matches(entry.path())) found.push_back(pid);
  }
  return found;
}

std::string contents(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

int kill_processes(std::initializer_list<std::string> words) {
  const auto pids = processes([&](const fs::path& process) {
    std::string line = contents(process / "cmdline");
    std::ranges::replace(line, '\0', ' ');
    return std::ranges::all_of(words,
                               [&](const std::string& word) { return line.find(word) != std::string::npos; });
  });
  for (const int pid : pids) ::kill(pid, SIGKILL);
  return static_cast<int>(pids.size());
}

std::string SlurmCluster::missing() {
  for (const char* program : {"munged", "slurmctld", "slurmd", "sbatch", "squeue", "scancel", "sinfo"}) {
    if (path_of(program).empty())
      return concat("there is no ", program, " here (Debian: apt-get install slurm-wlm munge)");
  }
  return ::getuid() == 0 ? "" : "slurmd needs root";
}

SlurmCluster::SlurmCluster() {
  for (const char* folder : {"munge", "state", "spool-w1", "spool-w2", "log"})
    fs::create_directories(file(folder));
  // munged wants its socket where everybody may reach it.
  fs::permissions(scratch_.path(), fs::perms(0755));
  first_port_ = free_ports();
  write_configuration();
  ::setenv("SLURM_CONF", file("slurm.conf").c_str(), 1);
  for (const char* daemon : {"munged", "slurmctld", "w1", "w2"}) start(daemon);
}

void SlurmCluster::write_configuration() {
  std::random_device random;
  std::string key;
  for (int i = 0; i < 128; ++i) key += static_cast<char>('a' + random() % 26);
  overwrite(file("munge/key"), key);
  fs::permissions(file("munge/key"), fs::perms(0600));
  std::string text = R"(ClusterName=flame
SlurmctldHost=HOST(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CredType=cred/munge
AuthInfo=socket=DIR/munge/socket
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
SlurmctldPort=PORT0
SlurmdPort=PORT1
StateSaveLocation=DIR/state
SlurmdSpoolDir=DIR/spool-%n
SlurmctldPidFile=DIR/slurmctld.pid
SlurmdPidFile=DIR/slurmd-%n.pid
SlurmctldLogFile=DIR/log/slurmctld.log
SlurmdLogFile=DIR/log/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SchedulerType=sched/backfill
SchedulerParameters=sched_interval=1,sched_min_interval=0,bf_interval=1,batch_sched_delay=0
SlurmdParameters=config_overrides
EnforcePartLimits=ALL
ReturnToService=2
KillWait=5
InactiveLimit=0
SlurmctldTimeout=30
SlurmdTimeout=30
NodeName=w[1-2] NodeHostName=HOST NodeAddr=127.0.0.1 Port=[PORT2-PORT3] CPUs=4 RealMemory=8000 State=UNKNOWN
PartitionName=flame Nodes=w[1-2] Default=YES MaxTime=INFINITE State=UP
PartitionName=live Nodes=w[1-2] MaxTime=INFINITE State=UP
PartitionName=closed Nodes=w[1-2] State=DOWN
PartitionName=members Nodes=w[1-2] AllowAccounts=members State=UP
)";
  const auto replace = [&](const std::string& what, const std::string& by) {
    for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size()))
      text.replace(at, what.size(), by);
  };
  replace("DIR", scratch_.path().string());
  replace("HOST", host());
  for (int i = 0; i < 4; ++i) replace(concat("PORT", i), std::to_string(first_port_ + i));
  overwrite(file("slurm.conf"), text);
}

void SlurmCluster::start(const std::string& daemon) {
  daemons_.erase(daemon);
  std::vector<std::string> arguments;
  std::string program = daemon;
  const auto at = [&](const std::string& name) { return file(name).string(); };
  if (daemon == "munged") {
    arguments = {"--foreground", "--force",          "--key-file",  at("munge/key"),
                 "--socket",     at("munge/socket"), "--pid-file",  at("munge/pid"),
                 "--log-file",   at("munge/log"),    "--seed-file", at("munge/seed")};
  } else if (daemon == "slurmctld") {
    arguments = {"-D", "-f", at("slurm.conf")};
  } else {
    program = "slurmd";
    arguments = {"-D", "-N", daemon, "-f", at("slurm.conf")};
  }
  daemons_.emplace(daemon,
                   ChildProcess::start(path_of(program), arguments, file("log/" + daemon + ".out")).value());
}

void SlurmCluster::kill(const std::string& daemon) {
  daemons_.at(daemon).signal(SIGKILL);
  daemons_.at(daemon).wait();
  daemons_.erase(daemon);
}

bool SlurmCluster::is_up() {
  for (const auto give_up = std::chrono::steady_clock::now() + 60s;
       std::chrono::steady_clock::now() < give_up;) {
    const auto nodes =
        run_program({"sinfo", "--noheader", "--Node", "--partition=flame", "--format=%N %t"}, 30s);
    if (nodes && nodes->out == "w1 idle\nw2 idle\n") return true;
    std::this_thread::sleep_for(100ms);
  }
  return false;
}

std::string SlurmCluster::logs() const {
  std::string all;
  for (const auto& entry : fs::directory_iterator(scratch_.path() / "log"))
    all += concat("== ", entry.path().filename().string(), '\n', contents(entry.path()));
  return all;
}

// Jobs first; then the daemons, which the ChildProcesses kill; then what belongs to nobody any more.
SlurmCluster::~SlurmCluster() {
  (void)run_program({"scancel", "--user=root"}, 20s);
  for (const auto give_up = std::chrono::steady_clock::now() + 15s;
       std::chrono::steady_clock::now() < give_up;) {
    const auto left = run_program({"squeue", "--noheader"}, 20s);
    if (!left || left->exit_code != 0 || left->out.empty()) break;
    std::this_thread::sleep_for(200ms);
  }
  daemons_.clear();
  const std::string mark = "SLURM_CONF=" + file("slurm.conf").string();
  for (const int pid : processes([&](const fs::path& process) {
         return contents(process / "environ").find(mark) != std::string::npos;
       }))
    ::kill(pid, SIGKILL);
  ::unsetenv("SLURM_CONF");
}

}  // namespace flamefield::testing_support
