#pragma once

#include <filesystem>
#include <string>

#include "proto/error.h"

namespace flamefield {

// SHA-256 (FIPS 180-4) of a file, as 64 hexadecimal digits: what `sha256sum` prints. NotFound, Unavailable.
Result<std::string> sha256_of_file(const std::filesystem::path& path);

}  // namespace flamefield
