#include "services/serve/endpoints.h"

namespace flamefield {

Result<Endpoints> endpoints_of(const std::filesystem::path& data_dir) {
  std::error_code code;
  const auto run = std::filesystem::absolute(data_dir, code).lexically_normal() / "run";
  std::filesystem::create_directories(run, code);
  if (code)
    return invalid_input("cannot make " + run.string(), code.message(), "choose another --data folder");
  constexpr std::size_t kLongestSocketPath = 107;  // sockaddr_un
  if ((run / "acquisition.sock").string().size() > kLongestSocketPath) {
    return invalid_input("data folder " + data_dir.string(),
                         concat("its sockets' paths would exceed ", kLongestSocketPath, " characters"),
                         "choose a shorter path");
  }
  const auto socket = [&](const char* name) { return "ipc://" + (run / name).string(); };
  return Endpoints{socket("dispatcher.sock"), socket("events.sock"), socket("acquisition.sock"),
                   socket("calibration.sock"), run.parent_path() / "keys"};
}

}  // namespace flamefield
