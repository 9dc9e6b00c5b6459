#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "services/study/study.h"

namespace flamefield {

struct StudyOptions {
  bool quick = false;
  int repeats = 0;                         // 0: as the study says
  std::vector<std::string> settings = {};  // TABLE.KEY=VALUE over all else but what is swept
};

// A study in TOML, by file name or the name of a shipped one ("paper", "mutation-rate" ...). One file may
// name others in `include`, each of which becomes a study of its own. InvalidInput with file and line:
// unknown keys (with the nearest known one), empty sweeps, lists of different length that should run
// together.
Result<std::vector<Study>> read_studies(const std::string& name_or_path, const StudyOptions& options);

std::vector<std::string> shipped_studies();

}  // namespace flamefield
