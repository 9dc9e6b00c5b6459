#pragma once

#include <filesystem>
#include <string>

#include "services/config/toml_file.h"
#include "services/study/study.h"

namespace flamefield {

// One study from its TOML keys. InvalidInput with file and line.
Result<Study> read_study(const TomlFile& file, const std::string& name, const std::filesystem::path& folder);

}  // namespace flamefield
