#include "services/bus/roles.h"

#include <array>

namespace flamefield {

namespace {

constexpr std::array<std::string_view, 4> kRoles = {"capture", "worker", "operator", "viewer"};

template <class... Kinds>
bool is_one_of(const Message& message) {
  return (std::holds_alternative<Kinds>(message) || ...);
}

}  // namespace

std::span<const std::string_view> peer_roles() {
  return kRoles;
}

bool may_send(std::string_view role, const Message& message) {
  const bool of_worker_alone = is_one_of<Ready, Heartbeat, Finish, Fail>(message);
  const bool of_capture_alone = is_one_of<PutSet, PutCapture>(message);
  if (role == "local") return true;
  if (role == "worker") return of_worker_alone || is_one_of<FetchSet>(message);
  if (role == "capture") return of_capture_alone || is_one_of<GetStatus, PutCalibration>(message);
  if (role == "viewer")
    return is_one_of<GetStatus, GetJobs, GetCapture, GetPreview, GetCalibration, FetchSet>(message);
  return role == "operator" && !of_worker_alone && !of_capture_alone;
}

Error forbidden(std::string_view whom, std::string_view role) {
  return invalid_input(concat("message to ", whom), concat("a ", role, " may not send it"),
                       "use the key of the right role")
      .value();
}

std::string role_named(std::string_view name) {
  if (name == "producer") return "capture";
  if (name == "client") return "operator";
  return std::string(name);
}

}  // namespace flamefield
