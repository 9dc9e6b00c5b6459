#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

// Stands between this test program and the disk: the functions of the C library that change files are defined
// again in disk.cc, and so are called by our code, by SQLite and by the standard library alike.
namespace flamefield::testing_support {

// One change below the recorded folder; paths are relative to it.
struct DiskEvent {
  enum class Kind { Create, Write, Resize, Allocate, Rename, Unlink, Sync, SyncFolder, Mark };
  Kind kind;
  std::string path;
  std::int64_t offset = 0;  // of Write; new size of Resize; least size of Allocate
  std::string bytes = {};   // of Write; new path of Rename; text of Mark
};

// Records what happens below `folder` from now on, in the order in which it happened.
void start_recording(const std::filesystem::path& folder);
void mark(const std::string& text);  // e.g. that something was acknowledged
std::vector<DiskEvent> stop_recording();

// While set, and when it returns an errno, the call fails with it. Asked before each change, with the
// absolute path; Sync for folders too; Create also when a file is opened for writing.
using DiskFault = std::function<int(DiskEvent::Kind, const std::string& path)>;
void set_disk_fault(DiskFault fault);

// Added to the wall clock of this process.
void set_clock_offset_ns(std::int64_t offset_ns);

}  // namespace flamefield::testing_support
