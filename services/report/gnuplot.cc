#include "services/report/gnuplot.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <system_error>

extern char** environ;

namespace flamefield {
namespace {

std::string contents_of(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

// Output goes to files, not pipes, so that neither side can block the other.
int spawn_and_wait(const std::filesystem::path& script, const std::filesystem::path& out,
                   const std::filesystem::path& err, int* status) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_addopen(&actions, 2, err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  std::string program = "gnuplot", defaults = "-d", file = script.string();
  const std::array<char*, 4> arguments = {program.data(), defaults.data(), file.data(), nullptr};
  pid_t child = 0;
  const int spawned = posix_spawnp(&child, "gnuplot", &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (spawned != 0) return spawned;
  while (waitpid(child, status, 0) < 0) {
    if (errno != EINTR) return errno;
  }
  return 0;
}

}  // namespace

ScratchFolder::ScratchFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "flamefield-plot-XXXXXX").string();
  if (!mkdtemp(name.data())) throw std::system_error(errno, std::generic_category(), name);
  path_ = name;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

Result<std::string> run_gnuplot(const std::string& script, const std::filesystem::path& folder) {
  const auto script_path = folder / "script.gp", out = folder / "stdout", err = folder / "stderr";
  std::ofstream(script_path, std::ios::binary) << script;
  int status = 0;
  if (const int error = spawn_and_wait(script_path, out, err, &status); error != 0) {
    return unavailable("cannot start gnuplot", std::generic_category().message(error),
                       "install the package gnuplot-nox");
  }
  // posix_spawnp may report a missing program as exit status 127.
  if (WIFEXITED(status) && WEXITSTATUS(status) == 127) {
    return unavailable("cannot start gnuplot", "no such program in PATH", "install the package gnuplot-nox");
  }
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    return invalid_input("gnuplot refused a plot", contents_of(err), "report this as a bug");
  }
  return contents_of(out);
}

}  // namespace flamefield
