#include "services/upkeep/check.h"

#include <algorithm>
#include <set>

#include "services/ledger/books.h"
#include "services/spool/reader.h"
#include "services/store/sha256.h"

namespace flamefield {

namespace fs = std::filesystem;

namespace {

// A set is whole when its record reads back, checksums and all, and is the set that the ledger names.
std::string fault_of_set(SpoolReader& spool, const StoredSet& stored) {
  const auto set = spool.read(stored.location);
  if (!set) return set.error().message;
  if (set->capture != stored.id.capture || set->index != stored.id.index)
    return concat("another set lies there: ", set->capture, " #", set->index);
  return {};
}

void check_sets(Books& books, const fs::path& directory, const LedgerCheckOptions& options,
                LedgerCheck& check, const std::function<bool()>& step) {
  const auto sets = books.sets();
  if (!sets || sets->empty() || !options.reads_spool) return;
  SpoolReader spool(directory / "spool");
  for (const StoredSet& stored : *sets) {
    if (!step()) return;
    ++check.sets;
    const std::string fault = fault_of_set(spool, stored);
    if (!fault.empty())
      check.faults.push_back({"set", concat(stored.id.capture, " #", stored.id.index), fault, true});
  }
}

void check_artefact(const Artefact& artefact, const fs::path& directory, const LedgerCheckOptions& options,
                    LedgerCheck& check) {
  std::error_code problem;
  const fs::path file = directory / artefact.path;
  const bool is_there = fs::is_regular_file(file, problem);
  if (artefact.retired_time_ns > 0) {
    ++check.retired;
    if (is_there) check.faults.push_back({"artefact-left", artefact.path, "it was retired", false});
    return;
  }
  ++check.artefacts;
  if (!is_there) {
    check.faults.push_back({"artefact-missing", artefact.path, concat("of run ", artefact.run_id), true});
    return;
  }
  if (artefact.sha256.empty()) {
    ++check.without_checksum;
    return;
  }
  if (!options.reads_artefacts) return;
  const auto hash = sha256_of_file(file);
  if (!hash || *hash != artefact.sha256)
    check.faults.push_back(
        {"artefact-changed", artefact.path,
         hash ? concat("SHA-256 is ", *hash, ", was ", artefact.sha256) : hash.error().message, true});
}

// Files of the volumes directory that no artefact names. Attempts under way have names of their own.
void find_strays(const std::vector<Artefact>& artefacts, const fs::path& directory, LedgerCheck& check) {
  std::set<std::string> known;
  for (const Artefact& artefact : artefacts) known.insert(artefact.path);
  std::error_code problem;
  for (const auto& entry : fs::directory_iterator(directory / "volumes", problem)) {
    const std::string name = entry.path().filename().string(), path = "volumes/" + name;
    if (name.starts_with('.')) continue;  // which directory it is
    if (path.find(".part-") == std::string::npos && !known.contains(path))
      check.faults.push_back({"stray-file", path, "the ledger does not know it", false});
  }
}

}  // namespace

bool LedgerCheck::is_sound() const {
  return std::ranges::none_of(faults, &LedgerFault::is_loss);
}

Result<LedgerCheck> check_ledger(const fs::path& directory, const LedgerCheckOptions& options,
                                 const std::function<void(std::int64_t, std::int64_t)>& progress,
                                 std::stop_token stop) {
  auto books = Books::open(directory);
  if (!books) return tl::unexpected(books.error());
  LedgerCheck check;
  const auto pages = books->integrity();
  if (!pages) return tl::unexpected(pages.error());
  for (const BookFault& fault : *pages) check.faults.push_back({fault.kind, fault.subject, fault.text, true});
  if (!check.is_sound()) return check;  // what damaged pages say of files is worth nothing
  const auto artefacts = books->artefacts();
  if (!artefacts) return tl::unexpected(artefacts.error());
  const auto sets = books->sets();
  const std::int64_t total =
      static_cast<std::int64_t>(artefacts->size()) + (sets ? static_cast<std::int64_t>(sets->size()) : 0);
  std::int64_t done = 0;
  const auto step = [&] {
    progress(done++, total);
    return !stop.stop_requested();
  };
  check_sets(*books, directory, options, check, step);
  for (const Artefact& artefact : *artefacts) {
    if (!step()) break;
    check_artefact(artefact, directory, options, check);
  }
  find_strays(*artefacts, directory, check);
  return check;
}

}  // namespace flamefield
