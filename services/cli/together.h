#pragma once

#include <optional>
#include <string>
#include <vector>

#include "reconstruct/ranks.h"
#include "services/cli/app.h"

namespace flamefield {

// One line of every rank, in their order.
std::vector<std::string> gather_texts(Ranks& ranks, const std::string& text);

// Ends the command on all ranks when it was about to end on any, with the first one's failure.
void fail_together(Ranks& ranks, const std::optional<CommandFailure>& failure);

// Ends the command when the ranks' texts differ: what is compared, in words.
void check_alike(Ranks& ranks, const std::string& what, const std::string& text);

// What all ranks do alike, e.g. read the same files.
template <class Work>
auto together(Ranks* ranks, const Work& work) {
  if (!ranks) return work();
  std::optional<decltype(work())> out;
  std::optional<CommandFailure> failure;
  try {
    out = work();
  } catch (const CommandFailure& caught) {
    failure = caught;
  }
  fail_together(*ranks, failure);
  return std::move(*out);
}

}  // namespace flamefield
