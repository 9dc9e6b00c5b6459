#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "proto/error.h"

namespace flamefield {

// Tells one volumes directory from another: a worker that would write elsewhere than where the dispatcher
// looks is refused at once, instead of failing at the end of its first job. A random name in a hidden file
// there.
inline constexpr std::string_view kNoDataId = "none";

// The name, made when there is none. Unavailable: cannot be written.
Result<std::string> make_data_id(const std::filesystem::path& data_dir);

// The name, or kNoDataId.
std::string read_data_id(const std::filesystem::path& data_dir);

}  // namespace flamefield
