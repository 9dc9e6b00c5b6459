#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "proto/job.h"
#include "services/spool/spool.h"

namespace flamefield {

struct ReadOnlyLedger;

struct Artefact {
  std::string path;  // relative to the data directory
  std::string run_id, kind, sha256;
  std::int64_t bytes = 0, retired_time_ns = 0;
};

struct StoredSet {
  SetId id;
  SpoolLocation location;
};

struct BookFault {
  std::string kind;  // page, reference
  std::string subject, text;
};

// The ledger as an auditor sees it. Read only; another process may be writing.
class Books {
 public:
  // NotFound: no ledger. InvalidInput: of another version. DataLoss: not readable as one.
  static Result<Books> open(const std::filesystem::path& directory);
  Books(Books&&) noexcept;
  ~Books();

  // Every page and every reference between tables; empty: all is well.
  Result<std::vector<BookFault>> integrity();
  Result<std::vector<Artefact>> artefacts();
  Result<std::vector<StoredSet>> sets();  // in the order of the spool

  // A copy of one moment, taken while the service goes on writing; it appears whole or not at all. Checked
  // before it gets its name. InvalidInput: the file exists.
  Result<> backup(const std::filesystem::path& file,
                  const std::function<void(std::int64_t done, std::int64_t total)>& progress);

 private:
  explicit Books(std::unique_ptr<ReadOnlyLedger> ledger);
  std::unique_ptr<ReadOnlyLedger> ledger_;
};

}  // namespace flamefield
