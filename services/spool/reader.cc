#include "services/spool/reader.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>

#include "services/spool/record.h"

namespace flamefield {

SpoolReader::~SpoolReader() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Result<FrameSet> SpoolReader::read(const SpoolLocation& location) {
  if (descriptor_ < 0 || segment_ != location.segment) {
    if (descriptor_ >= 0) ::close(descriptor_);
    char name[32];
    std::snprintf(name, sizeof name, "segment-%06u.raw", location.segment);
    descriptor_ = ::open((directory_ / name).c_str(), O_RDONLY | O_CLOEXEC);
    segment_ = location.segment;
    if (descriptor_ < 0)
      return not_found(concat("spool segment ", location.segment), std::strerror(errno),
                       "restore it from a backup");
  }
  struct stat info {};
  const std::uint64_t size = ::fstat(descriptor_, &info) == 0 ? static_cast<std::uint64_t>(info.st_size) : 0;
  auto record = read_record(descriptor_, location.segment, location.offset, size);
  if (!record) return tl::unexpected(record.error());
  return std::move(record->set);
}

}  // namespace flamefield
