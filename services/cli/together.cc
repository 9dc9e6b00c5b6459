#include "services/cli/together.h"

#include <algorithm>

#include "services/worker/machine.h"

namespace flamefield {

std::vector<std::string> gather_texts(Ranks& ranks, const std::string& text) {
  std::vector<std::string> out;
  for (const auto& bytes : ranks.gather(std::as_bytes(std::span(text)))) {
    std::string one(bytes.size(), ' ');
    std::ranges::transform(bytes, one.begin(), [](std::byte b) { return static_cast<char>(b); });
    out.push_back(std::move(one));
  }
  return out;
}

void fail_together(Ranks& ranks, const std::optional<CommandFailure>& failure) {
  const std::string mine =
      failure ? concat(failure->code == ExitCode::Usage ? 'u' : 'f', failure->message) : "";
  const auto all = gather_texts(ranks, mine);
  const auto first = std::ranges::find_if(all, [](const std::string& m) { return !m.empty(); });
  if (first == all.end()) return;
  const bool alike = std::ranges::count(all, *first) == static_cast<std::ptrdiff_t>(all.size());
  const std::string where = alike ? "" : concat("rank ", first - all.begin(), ": ");
  throw CommandFailure{first->front() == 'u' ? ExitCode::Usage : ExitCode::Failed, where + first->substr(1)};
}

void check_alike(Ranks& ranks, const std::string& what, const std::string& text) {
  const auto all = gather_texts(ranks, text);
  const auto other = std::ranges::find_if(all, [&](const std::string& t) { return t != all.front(); });
  const auto hosts = gather_texts(ranks, host_name());
  if (other == all.end()) return;
  const auto r = static_cast<std::size_t>(other - all.begin());
  throw CommandFailure{ExitCode::Usage, concat("rank ", r, " on ", hosts[r], " has another ", what, " (",
                                               *other, ", rank 0 on ", hosts[0], ": ", all[0],
                                               ") give all ranks the same files, program and processors")};
}

}  // namespace flamefield
