#include "tests/power/crash_image.h"

#include <algorithm>
#include <fstream>

namespace flamefield::testing_support {

namespace fs = std::filesystem;

namespace {

using Kind = DiskEvent::Kind;
constexpr std::size_t kSector = 512;

}  // namespace

void CrashImage::apply(const DiskEvent& event) {
  switch (event.kind) {
    case Kind::Mark:
      marks_.insert(event.bytes);
      return;
    case Kind::Create:
      return rename({"", event.path, std::make_shared<File>()});
    case Kind::Rename:
      return rename({event.path, event.bytes, names_.at(event.path)});
    case Kind::Unlink:
      return rename({event.path, "", nullptr});
    case Kind::Sync: {
      if (!names_.contains(event.path)) return;  // unlinked while it was open
      File& file = *names_.at(event.path);
      std::mt19937 unused;
      for (const DiskEvent& change_of_it : file.pending)
        change(file.sure, change_of_it, Unsynced::There, unused);
      file.pending.clear();
      return;
    }
    case Kind::SyncFolder:
      std::erase_if(pending_, [&](const NameChange& pending) {
        const fs::path name = pending.came.empty() ? pending.gone : pending.came;
        const bool here = name.parent_path() == event.path;
        if (here) apply(pending, sure_names_);
        return here;
      });
      return;
    case Kind::Write:
    case Kind::Resize:
    case Kind::Allocate:
      if (names_.contains(event.path)) names_.at(event.path)->pending.push_back(event);
      return;
  }
}

void CrashImage::rename(NameChange change) {
  apply(change, names_);
  pending_.push_back(std::move(change));
}

void CrashImage::apply(const NameChange& change, Names& names) {
  if (!change.gone.empty()) names.erase(change.gone);
  if (!change.came.empty()) names[change.came] = change.file;
}

void CrashImage::change(std::string& contents, const DiskEvent& event, Unsynced unsynced,
                        std::mt19937& random) {
  const auto happens = [&] { return unsynced == Unsynced::There || random() % 2 == 0; };
  const auto at = static_cast<std::size_t>(event.offset);
  if (event.kind == Kind::Resize) {
    if (happens()) contents.resize(at, '\0');
    return;
  }
  if (event.kind == Kind::Allocate) {
    if (happens()) contents.resize(std::max(contents.size(), at), '\0');
    return;
  }
  // Sectors are written whole, each or not, in any order.
  for (std::size_t from = 0; from < event.bytes.size();) {
    const std::size_t to = std::min(event.bytes.size(), (at + from) / kSector * kSector + kSector - at);
    if (happens()) {
      contents.resize(std::max(contents.size(), at + to), '\0');
      contents.replace(at + from, to - from, event.bytes, from, to - from);
    }
    from = to;
  }
}

void CrashImage::write(const fs::path& folder, Unsynced unsynced, std::mt19937& random) const {
  // Changes of names become durable in their order (a journal), up to any one of them.
  Names found = sure_names_;
  std::size_t count = unsynced == Unsynced::Lost ? 0 : pending_.size();
  if (unsynced == Unsynced::Torn) count = random() % (count + 1);
  for (std::size_t i = 0; i < count; ++i) apply(pending_[i], found);
  for (const auto& [path, file] : found) {
    std::string contents = file->sure;
    if (unsynced != Unsynced::Lost) {
      for (const DiskEvent& event : file->pending) change(contents, event, unsynced, random);
    }
    fs::create_directories((folder / path).parent_path());
    std::ofstream(folder / path, std::ios::binary) << contents;
  }
}

}  // namespace flamefield::testing_support
