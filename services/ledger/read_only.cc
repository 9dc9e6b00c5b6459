#include "services/ledger/read_only.h"

#include "services/ledger/ledger.h"
#include "services/ledger/schema.h"

namespace flamefield {

Result<std::unique_ptr<ReadOnlyLedger>> open_read_only(const std::filesystem::path& directory) {
  const std::string file = ledger_path(directory).string();
  if (!std::filesystem::exists(file))
    return not_found(concat("ledger ", file), "no such file",
                     "has anything been captured in this directory?");
  try {
    auto ledger = std::make_unique<ReadOnlyLedger>(file);
    if (ledger->database.execAndGet("PRAGMA user_version").getInt() != newest_schema_version())
      return invalid_input(concat("ledger ", file), "it is of another version than this program",
                           "start the dispatcher once to migrate it");
    return ledger;
  } catch (const SQLite::Exception& exception) {
    return tl::unexpected(error_of(exception, file));
  }
}

}  // namespace flamefield
