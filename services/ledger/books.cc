#include "services/ledger/books.h"

#include <SQLiteCpp/Backup.h>
#include <fcntl.h>
#include <unistd.h>

#include "services/ledger/read_only.h"

namespace flamefield {

namespace fs = std::filesystem;

namespace {

constexpr int kPagesPerStep = 1000;  // the writer gets its turn between steps
constexpr int kMostFaults = 100;

Result<std::vector<BookFault>> faults_of(SQLite::Database& database) {
  return guarded(database, [&]() -> Result<std::vector<BookFault>> {
    std::vector<BookFault> faults;
    try {
      SQLite::Statement pages(database, concat("PRAGMA integrity_check(", kMostFaults, ")"));
      while (pages.executeStep()) {
        const std::string text = pages.getColumn(0).getString();
        if (text != "ok") faults.push_back({"page", "ledger.sqlite", text});
      }
      SQLite::Statement references(database, "PRAGMA foreign_key_check");
      while (references.executeStep())
        faults.push_back(
            {"reference",
             concat(references.getColumn(0).getString(), " row ", references.getColumn(1).getInt64()),
             concat("names what is not in ", references.getColumn(2).getString())});
    } catch (const SQLite::Exception& problem) {  // too damaged to be checked is damaged
      faults.push_back({"page", "ledger.sqlite", problem.what()});
    }
    return faults;
  });
}

void sync_file(const fs::path& path, int flags) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | flags);
  if (fd < 0) return;
  ::fsync(fd);
  ::close(fd);
}

}  // namespace

Books::Books(std::unique_ptr<ReadOnlyLedger> ledger) : ledger_(std::move(ledger)) {}
Books::Books(Books&&) noexcept = default;
Books::~Books() = default;

Result<Books> Books::open(const fs::path& directory) {
  return open_read_only(directory).map(
      [](std::unique_ptr<ReadOnlyLedger> ledger) { return Books(std::move(ledger)); });
}

Result<std::vector<BookFault>> Books::integrity() {
  return faults_of(ledger_->database);
}

Result<std::vector<Artefact>> Books::artefacts() {
  return guarded(ledger_->database, [&]() -> Result<std::vector<Artefact>> {
    SQLite::Statement row(
        ledger_->database,
        "SELECT path, run_id, kind, sha256, bytes, retired_time_ns FROM artefacts ORDER BY path");
    std::vector<Artefact> all;
    while (row.executeStep())
      all.push_back({row.getColumn(0).getString(), row.getColumn(1).getString(), row.getColumn(2).getString(),
                     row.getColumn(3).getString(), row.getColumn(4).getInt64(), row.getColumn(5).getInt64()});
    return all;
  });
}

Result<std::vector<StoredSet>> Books::sets() {
  return guarded(ledger_->database, [&]() -> Result<std::vector<StoredSet>> {
    SQLite::Statement row(
        ledger_->database,
        "SELECT capture, idx, segment, byte_offset, byte_length FROM sets ORDER BY segment, byte_offset");
    std::vector<StoredSet> all;
    while (row.executeStep())
      all.push_back({{row.getColumn(0).getString(), row.getColumn(1).getInt64()},
                     {row.getColumn(2).getUInt(), static_cast<std::uint64_t>(row.getColumn(3).getInt64()),
                      static_cast<std::uint64_t>(row.getColumn(4).getInt64())}});
    return all;
  });
}

Result<> Books::backup(const fs::path& file,
                       const std::function<void(std::int64_t, std::int64_t)>& progress) {
  std::error_code problem;
  if (fs::exists(file, problem))
    return invalid_input(concat("backup ", file.string()), "the file exists", "choose another name");
  const fs::path part = file.string() + ".part";
  fs::remove(part, problem);
  auto copied = guarded(ledger_->database, [&]() -> Result<> {
    SQLite::Database copy(part.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    {
      SQLite::Backup backup(copy, ledger_->database);
      while (backup.executeStep(kPagesPerStep) != 101 /* SQLITE_DONE */)
        progress(backup.getTotalPageCount() - backup.getRemainingPageCount(), backup.getTotalPageCount());
    }
    copy.exec("PRAGMA journal_mode = DELETE");  // one file, without a log beside it
    const auto faults = faults_of(copy);
    if (!faults) return tl::unexpected(faults.error());
    if (!faults->empty())
      return data_loss(concat("backup ", file.string()), faults->front().text,
                       "the ledger itself is damaged: run 'flamefield ledger check'");
    return {};
  });
  if (!copied) {
    fs::remove(part, problem);
    return copied;
  }
  sync_file(part, 0);
  fs::rename(part, file, problem);
  if (problem) return unavailable(concat("backup ", file.string()), problem.message(), "check the directory");
  sync_file(fs::absolute(file).parent_path(), O_DIRECTORY);
  return {};
}

}  // namespace flamefield
