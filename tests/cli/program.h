#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cmath>
#include <cstdlib>
#include <string>

#include "services/store/file.h"
#include "tests/support/scratch.h"

// The real program, run as a user runs it.
namespace flamefield {

struct ProgramResult {
  int exit_code = -1;
  std::string out, err;
};

// Runs a shell line in `folder`; "$F" is the program.
inline ProgramResult shell(const std::filesystem::path& folder, const std::string& line) {
  const Scratch streams;
  const std::string command = "cd '" + folder.string() + "' && F='" FLAMEFIELD_BIN "/flamefield' && { " +
                              line + "; } > '" + (streams / "out").string() + "' 2> '" +
                              (streams / "err").string() + "'";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, *read_text_file(streams / "out"),
          *read_text_file(streams / "err")};
}

inline ProgramResult flamefield(const std::filesystem::path& folder, const std::string& arguments) {
  return shell(folder, "\"$F\" " + arguments);
}

// The number behind the last "key": of the text, which is the one outside of lists.
inline double json_number(const std::string& json, const std::string& key) {
  const auto at = json.rfind("\"" + key + "\":");
  EXPECT_NE(at, std::string::npos) << key << " in " << json;
  return at == std::string::npos ? NAN : std::strtod(json.c_str() + at + key.size() + 3, nullptr);
}

inline bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace flamefield
