#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "proto/error.h"

namespace flamefield {

struct LedgerFault {
  std::string kind;     // page, reference, set, artefact-missing, artefact-changed, artefact-left, stray-file
  std::string subject;  // a table, a set, a file
  std::string text;
  bool is_loss = true;  // false: untidy, nothing is lost
};

struct LedgerCheck {
  std::int64_t sets = 0, artefacts = 0, retired = 0;  // looked at
  std::int64_t without_checksum = 0;                  // artefacts of versions that kept none
  std::vector<LedgerFault> faults;
  bool is_sound() const;  // no fault is a loss
};

struct LedgerCheckOptions {
  bool reads_spool = true;      // every set, against its checksums
  bool reads_artefacts = true;  // every file, against its SHA-256; else only that it is there
};

// Compares everything that the ledger says with what lies in its directory. May run beside the service.
// NotFound: no ledger; Unavailable: it cannot be read at all.
Result<LedgerCheck> check_ledger(const std::filesystem::path& directory, const LedgerCheckOptions& options,
                                 const std::function<void(std::int64_t done, std::int64_t total)>& progress,
                                 std::stop_token stop);

}  // namespace flamefield
