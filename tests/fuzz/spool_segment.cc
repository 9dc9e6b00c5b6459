#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "proto/codec.h"
#include "services/spool/crc32c.h"
#include "services/spool/record.h"
#include "services/spool/spool.h"
#include "tests/fuzz/targets.h"

namespace flamefield::fuzz {

namespace {

namespace fs = std::filesystem;

// In memory where there is such a place, since every run syncs.
class Folder {
 public:
  Folder() {
    const fs::path memory = "/dev/shm";
    const fs::path place = ::access(memory.c_str(), W_OK) == 0 ? memory : fs::temp_directory_path();
    std::string name = (place / "flamefield-fuzz-XXXXXX").string();
    path_ = ::mkdtemp(name.data());
  }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

void set_checksum_right(std::vector<std::byte>& segment) {
  RecordHead head;
  if (segment.size() < sizeof head) return;
  std::memcpy(&head, segment.data(), sizeof head);
  head.magic = kRecordMagic;
  head.segment = 1;
  const std::uint64_t room = segment.size() - sizeof head;
  head.header_bytes = static_cast<std::uint32_t>(std::min<std::uint64_t>(head.header_bytes, room));
  head.payload_bytes = std::min<std::uint64_t>(head.payload_bytes, room - head.header_bytes);
  std::memcpy(segment.data(), &head, sizeof head);
  constexpr std::size_t kUnchecked = 2 * sizeof(std::uint32_t);  // magic and the checksum itself
  head.crc = crc32c(std::span(segment).subspan(kUnchecked, sizeof head - kUnchecked + head.header_bytes +
                                                               static_cast<std::size_t>(head.payload_bytes)));
  std::memcpy(segment.data(), &head, sizeof head);
}

}  // namespace

void spool_segment(Bytes bytes) {
  static const Folder folder;
  std::vector<std::byte> segment(bytes.size());
  std::memcpy(segment.data(), bytes.data(), bytes.size());
  set_checksum_right(segment);
  {
    std::ofstream out(folder.path() / "segment-000001.raw", std::ios::binary | std::ios::trunc);
    out.write(reinterpret_cast<const char*>(segment.data()), static_cast<std::streamsize>(segment.size()));
  }
  auto spool = Spool::open({.directory = folder.path(), .segment_bytes = 64 << 10});
  if (!spool) return;
  for (const RecoveredSet& found : spool->recovered()) {
    const auto set = spool->read(found.location);
    if (!set || set->frames.size() != found.set.frames.size()) std::abort();
    for (const Frame& frame : set->frames) {
      if (!frame.bytes ||
          frame.bytes->size() != bytes_of_image(frame.format, frame.width_px, frame.height_px))
        std::abort();
    }
  }
}

}  // namespace flamefield::fuzz
