#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "tests/power/disk.h"

namespace flamefield::testing_support {

// What a disk may hold after the power went, strictly by POSIX: bytes and sizes are sure after fsync of their
// file, names after fsync of their folder; of everything later any part may be there, sector by sector.
class CrashImage {
 public:
  enum class Unsynced { Lost, There, Torn };

  void apply(const DiskEvent& event);

  // Writes the files that may be found, into an empty folder.
  void write(const std::filesystem::path& folder, Unsynced unsynced, std::mt19937& random) const;

  const std::set<std::string>& acknowledged() const { return marks_; }

 private:
  struct File {
    std::string sure;                // contents
    std::vector<DiskEvent> pending;  // since the last sync
  };
  using Names = std::map<std::string, std::shared_ptr<File>>;
  static void change(std::string& contents, const DiskEvent& event, Unsynced unsynced, std::mt19937& random);

  struct NameChange {
    std::string gone, came;  // paths, or empty
    std::shared_ptr<File> file;
  };
  void rename(NameChange change);
  static void apply(const NameChange& change, Names& names);

  Names names_;                      // as the program sees them
  Names sure_names_;                 // as after a crash, at least
  std::vector<NameChange> pending_;  // what lies between
  std::set<std::string> marks_;
};

}  // namespace flamefield::testing_support
