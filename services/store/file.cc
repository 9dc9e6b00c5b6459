#include "services/store/file.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <utility>

namespace flamefield {

namespace fs = std::filesystem;

namespace {

tl::unexpected<Error> cannot_write(const fs::path& path, int error, std::string_view suggestion) {
  return invalid_input(concat("cannot write '", path.string(), "'"), std::strerror(error), suggestion);
}

fs::path folder_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

// A rename is on the disk only when its folder is. Some file systems refuse; the file itself is safe then.
void sync_folder(const fs::path& folder) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

}  // namespace

AtomicFile::AtomicFile(fs::path path, fs::path temporary, int descriptor)
    : path_(std::move(path)), temporary_(std::move(temporary)), descriptor_(descriptor) {}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : path_(std::move(other.path_)),
      temporary_(std::move(other.temporary_)),
      descriptor_(std::exchange(other.descriptor_, -1)) {}

AtomicFile::~AtomicFile() {
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  ::unlink(temporary_.c_str());
}

Result<AtomicFile> AtomicFile::create(const fs::path& path) {
  std::error_code ignored;
  if (!path.has_filename()) return cannot_write(path, EISDIR, "name a file");
  // Renaming over a device or a folder would destroy it.
  if (fs::exists(path, ignored) && !fs::is_regular_file(path, ignored)) {
    return cannot_write(path, fs::is_directory(path, ignored) ? EISDIR : EINVAL, "name a regular file");
  }
  static std::atomic<unsigned> counter{0};
  const fs::path temporary =
      folder_of(path) / concat(".", path.filename().string(), ".", ::getpid(), "-", counter++, ".part");
  const int descriptor = ::open(temporary.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (descriptor < 0) {
    return cannot_write(path, errno, "create the folder, mend its permissions, or choose another output");
  }
  return AtomicFile(path, temporary, descriptor);
}

Result<> AtomicFile::write(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return cannot_write(path_, errno, "free disk space or choose another output");
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return {};
}

Result<> AtomicFile::commit() {
  if (::fsync(descriptor_) != 0 || ::rename(temporary_.c_str(), path_.c_str()) != 0) {
    return cannot_write(path_, errno, "free disk space or choose another output");
  }
  ::close(std::exchange(descriptor_, -1));
  sync_folder(folder_of(path_));
  return {};
}

Result<> check_writable(const fs::path& path) {
  auto file = AtomicFile::create(path);
  if (!file) return tl::unexpected(file.error());
  return {};
}

Result<> write_text_file(const fs::path& path, std::string_view text) {
  auto file = AtomicFile::create(path);
  if (!file) return tl::unexpected(file.error());
  if (auto ok = file->write(text); !ok) return ok;
  return file->commit();
}

Result<InputFile> open_input(const fs::path& path) {
  const auto refuse = [&](std::string_view why) {
    return not_found(concat("cannot read '", path.string(), "'"), why, "check the path");
  };
  std::error_code error;
  const auto status = fs::status(path, error);
  if (!fs::exists(status)) return refuse("no such file");
  if (!fs::is_regular_file(status)) return refuse("not a regular file");
  InputFile file{std::ifstream(path, std::ios::binary), 0};
  if (!file.stream) return refuse(std::strerror(errno));
  file.size_bytes = fs::file_size(path, error);
  if (error) return refuse(error.message());
  return file;
}

Result<std::string> read_text_file(const fs::path& path, std::uint64_t limit_bytes) {
  auto file = open_input(path);
  if (!file) return tl::unexpected(file.error());
  if (file->size_bytes > limit_bytes) {
    return invalid_input(concat("'", path.string(), "' has ", file->size_bytes, " bytes"),
                         concat("at most ", limit_bytes, " are expected"), "name the right file");
  }
  std::string text(file->size_bytes, '\0');
  file->stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file->stream.gcount()));
  return text;
}

}  // namespace flamefield
