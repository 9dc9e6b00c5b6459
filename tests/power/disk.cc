#include "tests/power/disk.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <map>
#include <mutex>
#include <utility>

namespace flamefield::testing_support {

namespace {

using Kind = DiskEvent::Kind;

struct Recorder {
  std::recursive_mutex mutex;
  std::string root;  // empty: not recording
  std::vector<DiskEvent> events;
  std::map<int, std::string> open_files;  // absolute paths
  DiskFault fault;
};

Recorder& recorder() {
  static auto* one = new Recorder;  // calls may come until the very end
  return *one;
}

std::atomic<std::int64_t> clock_offset_ns{0};

template <class Function>
Function* next(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

std::string path_of(int fd) {
  const auto found = recorder().open_files.find(fd);
  return found == recorder().open_files.end() ? std::string() : found->second;
}

// Shared memory of the log's index: made anew after every crash.
bool is_volatile(const std::string& path) {
  return path.ends_with("-shm");
}

bool is_recorded(const std::string& path) {
  const std::string& root = recorder().root;
  return !root.empty() && path.starts_with(root) && path.size() > root.size() && !is_volatile(path);
}

void record(Kind kind, const std::string& path, std::int64_t offset = 0, std::string bytes = {}) {
  if (is_recorded(path))
    recorder().events.push_back({kind, path.substr(recorder().root.size() + 1), offset, std::move(bytes)});
}

bool fails(Kind kind, const std::string& path) {
  if (!recorder().fault || path.empty()) return false;
  const int error = recorder().fault(kind, path);
  if (error != 0) errno = error;
  return error != 0;
}

std::string absolute(const char* path) {
  return std::filesystem::absolute(path).lexically_normal().string();
}

int opened(const char* name, const char* path, int flags, unsigned mode) {
  const std::lock_guard lock(recorder().mutex);
  const std::string full = absolute(path);
  const bool writes = (flags & O_ACCMODE) != O_RDONLY;
  if (writes && fails(Kind::Create, full)) return -1;
  struct stat info {};
  const bool is_new = (flags & O_CREAT) != 0 && ::stat(path, &info) != 0;
  const int fd = next<int(const char*, int, ...)>(name)(path, flags, mode);
  if (fd < 0) return fd;
  recorder().open_files[fd] = full;
  if (is_new) record(Kind::Create, full);
  if (!is_new && writes && (flags & O_TRUNC) != 0) record(Kind::Resize, full, 0);
  return fd;
}

template <class Write>
ssize_t written(int fd, std::int64_t offset, const std::string& bytes, const Write& write) {
  const std::lock_guard lock(recorder().mutex);
  const std::string path = path_of(fd);
  if (fails(Kind::Write, path)) return -1;
  const std::int64_t at = offset >= 0 || path.empty() ? offset : ::lseek(fd, 0, SEEK_CUR);
  const ssize_t n = write();
  if (n > 0) record(Kind::Write, path, at, bytes.substr(0, static_cast<std::size_t>(n)));
  return n;
}

std::string joined(const iovec* pieces, int count) {
  std::string bytes;
  for (int i = 0; i < count; ++i)
    bytes.append(static_cast<const char*>(pieces[i].iov_base), pieces[i].iov_len);
  return bytes;
}

template <class Change>
int changed(Kind kind, int fd, std::int64_t size, const Change& change) {
  const std::lock_guard lock(recorder().mutex);
  const std::string path = path_of(fd);
  if (fails(kind, path)) return -1;
  const int result = change();
  if (result == 0) record(kind, path, size);
  return result;
}

int synced(int fd, const char* name) {
  const std::lock_guard lock(recorder().mutex);
  const std::string path = path_of(fd);
  if (fails(Kind::Sync, path)) return -1;
  // Real disks are slow, and nobody pulls this one's plug.
  if (recorder().root.empty()) return next<int(int)>(name)(fd);
  struct stat info {};
  const bool is_folder = ::fstat(fd, &info) == 0 && S_ISDIR(info.st_mode);
  if (is_folder && path == recorder().root)
    recorder().events.push_back({Kind::SyncFolder, ""});
  else
    record(is_folder ? Kind::SyncFolder : Kind::Sync, path);
  return 0;
}

}  // namespace

void start_recording(const std::filesystem::path& folder) {
  const std::lock_guard lock(recorder().mutex);
  recorder().root = std::filesystem::absolute(folder).lexically_normal().string();
  recorder().events.clear();
}

void mark(const std::string& text) {
  const std::lock_guard lock(recorder().mutex);
  recorder().events.push_back({Kind::Mark, "", 0, text});
}

std::vector<DiskEvent> stop_recording() {
  const std::lock_guard lock(recorder().mutex);
  recorder().root.clear();
  return std::exchange(recorder().events, {});
}

void set_disk_fault(DiskFault fault) {
  const std::lock_guard lock(recorder().mutex);
  recorder().fault = std::move(fault);
}

void set_clock_offset_ns(std::int64_t offset_ns) {
  clock_offset_ns = offset_ns;
}

}  // namespace flamefield::testing_support

using namespace flamefield::testing_support;

extern "C" {

int open(const char* path, int flags, ...) {
  va_list more;
  va_start(more, flags);
  const unsigned mode = (flags & O_CREAT) != 0 ? va_arg(more, unsigned) : 0;
  va_end(more);
  return opened("open", path, flags, mode);
}
int open64(const char* path, int flags, ...) {
  va_list more;
  va_start(more, flags);
  const unsigned mode = (flags & O_CREAT) != 0 ? va_arg(more, unsigned) : 0;
  va_end(more);
  return opened("open64", path, flags, mode);
}
int close(int fd) {
  {
    const std::lock_guard lock(recorder().mutex);
    recorder().open_files.erase(fd);
  }
  return static_cast<int>(::syscall(SYS_close, fd));
}
ssize_t write(int fd, const void* bytes, size_t n) {
  return written(fd, -1, std::string(static_cast<const char*>(bytes), n),
                 [&] { return static_cast<ssize_t>(::syscall(SYS_write, fd, bytes, n)); });
}
ssize_t writev(int fd, const iovec* pieces, int count) {
  return written(fd, -1, joined(pieces, count),
                 [&] { return static_cast<ssize_t>(::syscall(SYS_writev, fd, pieces, count)); });
}
ssize_t pwrite(int fd, const void* bytes, size_t n, off_t offset) {
  return written(fd, offset, std::string(static_cast<const char*>(bytes), n),
                 [&] { return static_cast<ssize_t>(::syscall(SYS_pwrite64, fd, bytes, n, offset)); });
}
ssize_t pwrite64(int fd, const void* bytes, size_t n, off64_t offset) {
  return written(fd, offset, std::string(static_cast<const char*>(bytes), n),
                 [&] { return static_cast<ssize_t>(::syscall(SYS_pwrite64, fd, bytes, n, offset)); });
}
ssize_t pwritev(int fd, const iovec* pieces, int count, off_t offset) {
  return written(fd, offset, joined(pieces, count), [&] {
    return next<ssize_t(int, const iovec*, int, off_t)>("pwritev")(fd, pieces, count, offset);
  });
}
int ftruncate(int fd, off_t size) noexcept {
  return changed(Kind::Resize, fd, size,
                 [&] { return static_cast<int>(::syscall(SYS_ftruncate, fd, size)); });
}
int ftruncate64(int fd, off64_t size) noexcept {
  return changed(Kind::Resize, fd, size,
                 [&] { return static_cast<int>(::syscall(SYS_ftruncate, fd, size)); });
}
int posix_fallocate(int fd, off_t offset, off_t length) {
  const int result = changed(Kind::Allocate, fd, offset + length, [&] {
    return next<int(int, off_t, off_t)>("posix_fallocate")(fd, offset, length);
  });
  return result < 0 ? errno : result;
}
int fsync(int fd) {
  return synced(fd, "fsync");
}
int fdatasync(int fd) {
  return synced(fd, "fdatasync");
}
int rename(const char* from, const char* to) noexcept {
  const std::lock_guard lock(recorder().mutex);
  const std::string old_name = absolute(from), new_name = absolute(to);
  if (fails(Kind::Rename, old_name)) return -1;
  const int result = static_cast<int>(::syscall(SYS_rename, from, to));
  if (result == 0 && is_recorded(old_name))
    record(Kind::Rename, old_name, 0, new_name.substr(recorder().root.size() + 1));
  return result;
}
int unlink(const char* path) noexcept {
  const std::lock_guard lock(recorder().mutex);
  const std::string full = absolute(path);
  const int result = static_cast<int>(::syscall(SYS_unlink, path));
  if (result == 0) record(Kind::Unlink, full);
  return result;
}
int clock_gettime(clockid_t clock, timespec* time) noexcept {
  const int result = static_cast<int>(::syscall(SYS_clock_gettime, clock, time));
  if (clock == CLOCK_REALTIME && result == 0) {
    const std::int64_t ns = time->tv_sec * 1'000'000'000LL + time->tv_nsec + clock_offset_ns;
    time->tv_sec = ns / 1'000'000'000;
    time->tv_nsec = ns % 1'000'000'000;
  }
  return result;
}

}  // extern "C"
