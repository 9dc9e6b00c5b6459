#include "services/process/run_program.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>

extern char** environ;

namespace flamefield {

namespace {

using Clock = std::chrono::steady_clock;
constexpr std::size_t kMostBytes = std::size_t{1} << 30;

class Pipe {
 public:
  Pipe() {
    if (::pipe2(ends_.data(), O_CLOEXEC) != 0) ends_ = {-1, -1};
  }
  ~Pipe() {
    close(0);
    close(1);
  }
  Pipe(const Pipe&) = delete;
  int reader() const { return ends_[0]; }
  int writer() const { return ends_[1]; }
  void close(std::size_t end) {
    if (ends_[end] >= 0) ::close(ends_[end]);
    ends_[end] = -1;
  }

 private:
  std::array<int, 2> ends_{-1, -1};
};

int spawn(const std::vector<std::string>& command, const Pipe& out, const Pipe& err, pid_t* pid) {
  std::vector<char*> argv;
  for (const std::string& word : command) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, out.writer(), 1);
  posix_spawn_file_actions_adddup2(&actions, err.writer(), 2);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes, &none);
  const int problem = ::posix_spawnp(pid, command[0].c_str(), &actions, &attributes, argv.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  return problem;
}

// True when there will be more.
bool take(int fd, std::string& into) {
  std::array<char, 65536> bytes{};
  const ssize_t got = ::read(fd, bytes.data(), bytes.size());
  if (got > 0) into.append(bytes.data(), static_cast<std::size_t>(got));
  return got > 0 || (got < 0 && errno == EINTR);
}

// Both streams at once, so that the program never waits for us; false when it took too long or said too much.
bool collect(Pipe& out, Pipe& err, ProgramOutput& output, Clock::time_point deadline) {
  while (out.reader() >= 0 || err.reader() >= 0) {
    std::array<pollfd, 2> ends = {pollfd{out.reader(), POLLIN, 0}, pollfd{err.reader(), POLLIN, 0}};
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count();
    if (left <= 0 || output.out.size() + output.err.size() > kMostBytes) return false;
    if (::poll(ends.data(), ends.size(), static_cast<int>(std::min<std::int64_t>(left, 1000))) <= 0) continue;
    if (ends[0].revents != 0 && !take(out.reader(), output.out)) out.close(0);
    if (ends[1].revents != 0 && !take(err.reader(), output.err)) err.close(0);
  }
  return true;
}

}  // namespace

Result<ProgramOutput> run_program(const std::vector<std::string>& command,
                                  std::chrono::milliseconds timeout) {
  Pipe out, err;
  pid_t pid = 0;
  if (const int problem = spawn(command, out, err, &pid); problem != 0)
    return not_found(concat("program ", command[0]), std::strerror(problem), "is it installed, and in PATH?");
  out.close(1);
  err.close(1);
  ProgramOutput output;
  const bool ended = collect(out, err, output, Clock::now() + timeout);
  if (!ended) ::kill(pid, SIGKILL);
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  if (!ended)
    return unavailable(concat("program ", command[0]),
                       concat("it did not end within ", timeout.count(), " ms"), "try again later");
  output.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return output;
}

}  // namespace flamefield
