#include "services/process/supervisor.h"

#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <new>
#include <thread>

#include "services/log/log.h"

namespace flamefield {

namespace {

using Number = std::atomic<std::int64_t>;
constexpr int kMostIdleDeaths = 5;

sigset_t watched() {
  sigset_t set;
  sigemptyset(&set);
  for (const int number : {SIGCHLD, SIGTERM, SIGINT, SIGUSR1}) sigaddset(&set, number);
  return set;
}

// Until the child ends; its wait status.
int wait_for(pid_t child) {
  const sigset_t set = watched();
  while (true) {
    int status = 0;
    if (::waitpid(child, &status, WNOHANG) == child) return status;
    siginfo_t info{};
    const timespec tick{1, 0};
    const int got = ::sigtimedwait(&set, &info, &tick);
    // A terminal sends Ctrl-C to both of us.
    if (got == SIGTERM || got == SIGUSR1 || (got == SIGINT && info.si_code == SI_USER)) ::kill(child, got);
  }
}

[[noreturn]] void live_and_end(const std::function<int(Life&)>& live, Life& life, pid_t parent,
                               const sigset_t& mask) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // nobody works on when the watcher is gone
  if (::getppid() != parent) ::_exit(1);
  ::sigprocmask(SIG_SETMASK, &mask, nullptr);
  const int code = live(life);
  std::fflush(nullptr);
  ::_exit(code);
}

}  // namespace

int supervise(const std::function<int(Life&)>& live) {
  void* page = ::mmap(nullptr, sizeof(Number), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (page == MAP_FAILED) return 1;
  Life life{*new (page) Number(0), 0, {}};
  const sigset_t blocked = watched();
  sigset_t before;
  ::sigprocmask(SIG_BLOCK, &blocked, &before);
  sigaddset(&before, SIGUSR1);  // for the child to wait for, not to die of
  for (int idle_deaths = 0; idle_deaths < kMostIdleDeaths;) {
    life.in_hand = 0;
    const pid_t parent = ::getpid();
    const pid_t child = ::fork();
    if (child < 0) return 1;
    if (child == 0) live_and_end(live, life, parent, before);
    const int status = wait_for(child);
    if (WIFEXITED(status)) return WEXITSTATUS(status);
    life.lost = life.in_hand;
    life.death = concat("killed by signal ", WTERMSIG(status), " (", ::strsignal(WTERMSIG(status)), ')');
    log_event(LogLevel::Error, "worker-died", {{"why", life.death}, {"token", life.lost}});
    idle_deaths = life.lost == 0 ? idle_deaths + 1 : 0;
    std::this_thread::sleep_for(std::chrono::milliseconds(100) * (1 << std::min(idle_deaths, 5)));
  }
  return 1;
}

}  // namespace flamefield
