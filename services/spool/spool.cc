#include "services/spool/spool.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <utility>

#include "proto/check.h"
#include "proto/codec.h"
#include "services/spool/record.h"

namespace flamefield {

namespace fs = std::filesystem;

namespace {

tl::unexpected<Error> cannot(std::string_view act, const fs::path& path, int error) {
  const bool full = error == ENOSPC || error == EFBIG || error == EDQUOT;
  return unavailable(
      concat("cannot ", act, ' ', path.string()), std::strerror(error),
      full ? "free disk space; what was acknowledged is safe" : "check the disk and its permissions");
}

bool write_fully(int descriptor, std::vector<iovec> pieces, std::uint64_t offset) {
  std::size_t first = 0;
  while (first < pieces.size()) {
    const int count = static_cast<int>(std::min<std::size_t>(pieces.size() - first, 512));
    ssize_t n = ::pwritev(descriptor, &pieces[first], count, static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return false;
    offset += static_cast<std::uint64_t>(n);
    while (first < pieces.size() && static_cast<std::size_t>(n) >= pieces[first].iov_len) {
      n -= static_cast<ssize_t>(pieces[first].iov_len);
      ++first;
    }
    if (first < pieces.size()) {
      pieces[first].iov_base = static_cast<char*>(pieces[first].iov_base) + n;
      pieces[first].iov_len -= static_cast<std::size_t>(n);
    }
  }
  return true;
}

void sync_directory(const fs::path& directory) {
  const int fd = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;
  ::fsync(fd);
  ::close(fd);
}

std::uint64_t size_of(int descriptor) {
  struct stat info {};
  return ::fstat(descriptor, &info) == 0 ? static_cast<std::uint64_t>(info.st_size) : 0;
}

}  // namespace

Spool::Spool(Spool&& other) noexcept
    : options_(std::move(other.options_)),
      segment_(other.segment_),
      tail_(other.tail_),
      size_(other.size_),
      unsynced_(other.unsynced_),
      broken_(other.broken_),
      descriptors_(std::exchange(other.descriptors_, {})),
      recovered_(std::move(other.recovered_)) {}

Spool::~Spool() {
  for (const auto& [segment, descriptor] : descriptors_) ::close(descriptor);
}

Result<Spool> Spool::open(const SpoolOptions& options, const SpoolLocation& durable) {
  std::error_code problem;
  fs::create_directories(options.directory, problem);
  if (problem) return cannot("create", options.directory, problem.value());
  Spool spool(options);
  if (auto ok = spool.recover(durable); !ok) return tl::unexpected(ok.error());
  return spool;
}

fs::path Spool::path_of(std::uint32_t segment) const {
  std::string number = std::to_string(segment);
  if (number.size() < 6) number.insert(0, 6 - number.size(), '0');
  return options_.directory / ("segment-" + number + ".raw");
}

Result<int> Spool::descriptor_of(std::uint32_t segment) {
  if (const auto found = descriptors_.find(segment); found != descriptors_.end()) return found->second;
  const int fd = ::open(path_of(segment).c_str(), O_RDWR | O_CLOEXEC);
  if (fd < 0)
    return not_found(concat("spool segment ", segment), std::strerror(errno), "restore it from a backup");
  // Old segments are read seldom: keep few of them open.
  if (descriptors_.size() >= 16) {
    const auto oldest = descriptors_.begin();
    ::close(oldest->second);
    descriptors_.erase(oldest);
  }
  descriptors_[segment] = fd;
  return fd;
}

Result<> Spool::recover(const SpoolLocation& durable) {
  segment_ = durable.segment;
  bool present = segment_ != 0 && fs::exists(path_of(segment_));
  std::uint64_t from = durable.offset + durable.length;
  while (true) {
    if (present) {
      const auto end = scan(segment_, from);
      if (!end) return tl::unexpected(end.error());
      tail_ = *end;
    }
    if (!fs::exists(path_of(segment_ + 1))) break;
    ++segment_;
    present = true;
    from = 0;
  }
  if (!present) return {};  // the next append starts a segment
  // What follows the tail is torn: make it zeros again, so that it can never be taken for a record.
  const auto fd = descriptor_of(segment_);
  if (!fd) return tl::unexpected(fd.error());
  size_ = std::max(size_of(*fd), tail_);
  if (::ftruncate(*fd, static_cast<off_t>(tail_)) != 0) return cannot("truncate", path_of(segment_), errno);
  if (::posix_fallocate(*fd, 0, static_cast<off_t>(size_)) != 0) size_ = tail_;  // full: a new segment is due
  if (::fdatasync(*fd) != 0) return cannot("sync", path_of(segment_), errno);
  return {};
}

// Collects the whole records from `from` on; returns where they end.
Result<std::uint64_t> Spool::scan(std::uint32_t segment, std::uint64_t from) {
  const auto fd = descriptor_of(segment);
  if (!fd) return tl::unexpected(fd.error());
  const std::uint64_t size = size_of(*fd);
  while (auto record = read_record(*fd, segment, from, size)) {
    for (Frame& frame : record->set.frames) frame.bytes = nullptr;
    recovered_.push_back({std::move(record->set), {segment, from, record->length}});
    from += record->length;
  }
  return from;
}

Result<> Spool::start_segment(std::uint32_t segment, std::uint64_t bytes) {
  if (auto ok = sync(); !ok) return ok;  // sync() afterwards looks at the new segment only
  const fs::path path = path_of(segment);
  const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (fd < 0) return cannot("create", path, errno);
  const int problem = ::posix_fallocate(fd, 0, static_cast<off_t>(bytes));
  if (problem != 0 || ::fsync(fd) != 0) {
    const int reason = problem != 0 ? problem : errno;
    ::close(fd);
    ::unlink(path.c_str());
    return cannot("allocate", path, reason);
  }
  sync_directory(options_.directory);
  descriptors_[segment] = fd;
  segment_ = segment;
  tail_ = 0;
  size_ = bytes;
  return {};
}

Result<SpoolLocation> Spool::append(const FrameSet& set) {
  for (const Frame& frame : set.frames) expect(frame.bytes != nullptr, "frames of a set have pixels");
  if (broken_)
    return unavailable("the spool is closed for writing", "an fdatasync failed",
                       "check the disk, then restart");
  const std::string header = encode(PutSet{set});
  const std::uint64_t needed = record_length(sizes_of(header, set));
  if (size_ - tail_ < needed) {
    if (auto ok = start_segment(segment_ + 1, std::max(options_.segment_bytes, needed)); !ok)
      return tl::unexpected(ok.error());
  }
  RecordHead head = make_head(segment_, header, set);
  std::vector<iovec> pieces = {{&head, sizeof head}, {const_cast<char*>(header.data()), header.size()}};
  for (const Frame& frame : set.frames)
    pieces.push_back({const_cast<std::byte*>(frame.bytes->data()), frame.bytes->size()});
  const auto fd = descriptor_of(segment_);
  if (!fd) return tl::unexpected(fd.error());
  // A partly written record is no harm: the tail stays, and the next record overwrites it.
  if (!write_fully(*fd, std::move(pieces), tail_)) return cannot("write", path_of(segment_), errno);
  const SpoolLocation location{segment_, tail_, record_length(head)};
#if defined(__linux__)
  // The disk begins now, while further sets are copied; sync() waits for the rest. Only a hint: no error
  // counts.
  ::sync_file_range(*fd, static_cast<off64_t>(tail_), static_cast<off64_t>(location.length),
                    SYNC_FILE_RANGE_WRITE);
#endif
  tail_ += location.length;
  unsynced_ = true;
  return location;
}

Result<> Spool::sync() {
  if (!unsynced_) return {};
  const auto fd = descriptor_of(segment_);
  if (!fd) return tl::unexpected(fd.error());
  if (::fdatasync(*fd) != 0) {
    broken_ = true;
    return cannot("sync", path_of(segment_), errno);
  }
  unsynced_ = false;
  return {};
}

Result<FrameSet> Spool::read(const SpoolLocation& location) {
  const auto fd = descriptor_of(location.segment);
  if (!fd) return tl::unexpected(fd.error());
  auto record = read_record(*fd, location.segment, location.offset, size_of(*fd));
  if (!record) return tl::unexpected(record.error());
  return std::move(record->set);
}

}  // namespace flamefield
