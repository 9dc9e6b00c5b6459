#include "services/store/frame_file.h"

#include <algorithm>
#include <map>

#include "proto/check.h"
#include "services/store/file.h"
#include "services/store/h5_output.h"

namespace flamefield {

namespace {

// All that one camera gave, set by set.
struct CameraRecord {
  std::vector<std::string> status;   // of every set
  std::vector<const Frame*> frames;  // of the sets where status is "stored"
};
constexpr std::string_view kStored = "stored", kAbsent = "absent";

PixelFormat stored_format(PixelFormat format) {
  return format == PixelFormat::Mono12Packed ? PixelFormat::Mono12 : format;
}

Result<std::map<std::string, CameraRecord>> by_camera(const std::vector<FrameSet>& sets) {
  std::map<std::string, CameraRecord> cameras;
  const auto record_of = [&](const std::string& name) -> CameraRecord& {
    CameraRecord& record = cameras[name];
    record.status.resize(sets.size(), std::string(kAbsent));
    return record;
  };
  for (std::size_t s = 0; s < sets.size(); ++s) {
    for (const FrameLoss& loss : sets[s].losses) record_of(loss.camera).status[s] = name_of(loss.cause);
    for (const Frame& frame : sets[s].frames) {
      CameraRecord& record = record_of(frame.camera);
      if (record.status[s] == kStored) {
        return invalid_input(concat("set ", s, " has two frames of ", frame.camera),
                             "one a pulse is possible", "drop one of them");
      }
      record.status[s] = kStored;
      record.frames.push_back(&frame);
    }
  }
  return cameras;
}

Result<> check_equal(const std::string& camera, const std::vector<const Frame*>& frames) {
  for (const Frame* frame : frames) {
    const Frame& first = *frames.front();
    if (frame->width_px != first.width_px || frame->height_px != first.height_px ||
        frame->format != first.format) {
      return invalid_input(concat("the frames of camera ", camera, " differ in size or format"),
                           "one file holds frames of one kind", "write them to two files");
    }
  }
  return {};
}

// numeric column of one row a frame
template <class Get>
void write_column(H5Group& group, const std::string& name, std::size_t rows, Get get) {
  std::vector<std::int64_t> column(rows);
  for (std::size_t i = 0; i < rows; ++i) column[i] = get(i);
  group.write<std::int64_t>(name, column, {rows});
}

// NXtomo's image_key: 0 projection, 1 flat, 2 dark, 3 other.
std::int64_t image_key(CaptureKind kind) {
  if (kind == CaptureKind::Burst || kind == CaptureKind::Live) return 0;
  if (kind == CaptureKind::Flat) return 1;
  return kind == CaptureKind::Dark ? 2 : 3;
}

void write_sets(H5Group& entry, const std::vector<FrameSet>& sets) {
  H5Group table = entry.create_group("sets", "NXcollection");
  std::vector<std::string> captures, kinds;
  for (const FrameSet& set : sets) {
    captures.push_back(set.capture);
    kinds.emplace_back(name_of(set.kind));
  }
  table.write_texts("capture", captures);
  table.write_texts("kind", kinds);
  write_column(table, "image_key", sets.size(), [&](auto i) { return image_key(sets[i].kind); });
  write_column(table, "pulse", sets.size(), [&](auto i) { return sets[i].pulse; });
  write_column(table, "index", sets.size(), [&](auto i) { return sets[i].index; });
  write_column(table, "pulse_time_ns", sets.size(), [&](auto i) { return sets[i].pulse_time_ns; });
  write_column(table, "complete_time_ns", sets.size(), [&](auto i) { return sets[i].complete_time_ns; });
}

Result<> write_pixels(H5Group& detector, const std::vector<const Frame*>& frames) {
  const Frame& first = *frames.front();
  const PixelFormat format = stored_format(first.format);
  const H5Number number = bits_of(format) == 8 ? H5Number::U8 : H5Number::U16;
  detector.create(
      "data", number,
      {frames.size(), static_cast<std::size_t>(first.height_px), static_cast<std::size_t>(first.width_px)},
      H5Layout::Zipped);
  detector.set_text("pixel_format", name_of(format), "data");
  for (std::size_t i = 0; i < frames.size(); ++i) {
    auto image = grey_levels(*frames[i]);
    if (!image) return tl::unexpected(image.error());
    if (number == H5Number::U8) {
      const std::vector<std::uint8_t> pixels(image->pixels.begin(), image->pixels.end());
      detector.write_slice("data", i, number, pixels.data());
    } else {
      const std::vector<std::uint16_t> pixels(image->pixels.begin(), image->pixels.end());
      detector.write_slice("data", i, number, pixels.data());
    }
  }
  return {};
}

Result<> write_camera(H5Group& instrument, const std::string& name, const CameraRecord& record) {
  if (name.empty() || name.find('/') != std::string::npos || name == ".") {
    return invalid_input(concat("camera name '", name, "'"), "it becomes a name in the file",
                         "rename the camera");
  }
  if (auto ok = check_equal(name, record.frames); !ok) return ok;
  H5Group detector = instrument.create_group(name, "NXdetector");
  detector.write_texts("status", record.status);
  const auto& frames = record.frames;
  write_column(detector, "pulse", frames.size(), [&](auto i) { return frames[i]->pulse; });
  write_column(detector, "device_time_ns", frames.size(), [&](auto i) { return frames[i]->device_time_ns; });
  write_column(detector, "arrival_time_ns", frames.size(),
               [&](auto i) { return frames[i]->arrival_time_ns; });
  write_column(detector, "exposure_us", frames.size(), [&](auto i) { return frames[i]->exposure_us; });
  if (frames.empty()) return {};
  return write_pixels(detector, frames);
}

// --- reading ---

std::vector<std::int64_t> read_column(const H5Group& group, const std::string& name, std::size_t rows) {
  H5Shape shape;
  auto column = group.read<std::int64_t>(name, shape);
  if (shape != H5Shape{rows}) throw H5Failure(concat("table '", name, "' has the wrong length"));
  return column;
}

std::vector<FrameSet> read_sets(const H5Group& table) {
  const auto captures = table.read_texts("capture"), kinds = table.read_texts("kind");
  if (captures.size() != kinds.size()) throw H5Failure("the tables of sets differ in length");
  std::vector<FrameSet> sets(captures.size());
  const auto pulses = read_column(table, "pulse", sets.size()),
             indices = read_column(table, "index", sets.size());
  const auto pulse_times = read_column(table, "pulse_time_ns", sets.size());
  const auto complete_times = read_column(table, "complete_time_ns", sets.size());
  for (std::size_t i = 0; i < sets.size(); ++i) {
    const auto kind = capture_kind_from_name(kinds[i]);
    if (!kind) throw H5Failure(concat("unknown kind of capture '", kinds[i], "'"));
    sets[i].capture = captures[i];
    sets[i].kind = *kind;
    sets[i].pulse = pulses[i];
    sets[i].index = indices[i];
    sets[i].pulse_time_ns = pulse_times[i];
    sets[i].complete_time_ns = complete_times[i];
  }
  return sets;
}

// Without the pixels.
std::vector<Frame> read_camera_frames(const H5Group& detector, const std::string& camera, std::size_t count) {
  std::vector<Frame> frames(count);
  if (count == 0) return frames;
  const H5Shape shape = detector.checked_shape("data");
  const auto format = pixel_format_from_name(detector.text_of_dataset("data", "pixel_format"));
  if (shape.size() != 3 || shape[0] != count || shape[1] > 1u << 16 || shape[2] > 1u << 16 || !format ||
      *format != stored_format(*format)) {
    throw H5Failure(concat("the frames of camera ", camera, " do not fit their tables"));
  }
  const auto pulses = read_column(detector, "pulse", count);
  const auto device_times = read_column(detector, "device_time_ns", count);
  const auto arrival_times = read_column(detector, "arrival_time_ns", count);
  const auto exposures = read_column(detector, "exposure_us", count);
  for (std::size_t i = 0; i < count; ++i) {
    Frame& frame = frames[i];
    frame.camera = camera;
    frame.pulse = pulses[i];
    frame.device_time_ns = device_times[i];
    frame.arrival_time_ns = arrival_times[i];
    frame.exposure_us = static_cast<int>(std::clamp<std::int64_t>(exposures[i], 0, 1 << 30));
    frame.height_px = static_cast<int>(shape[1]);
    frame.width_px = static_cast<int>(shape[2]);
    frame.format = *format;
  }
  return frames;
}

H5Number number_of(PixelFormat format) {
  return bits_of(format) == 8 ? H5Number::U8 : H5Number::U16;
}

void read_pixels(const H5Group& detector, std::size_t index, Frame& frame) {
  auto bytes =
      std::make_shared<std::vector<std::byte>>(bytes_of_image(frame.format, frame.width_px, frame.height_px));
  detector.read_slice("data", index, number_of(frame.format), bytes->data());
  frame.bytes = std::move(bytes);
}

// Where the pixels of a set's frames are.
struct FrameIndex {
  std::vector<FrameSet> sets;                      // without pixels
  std::vector<std::vector<std::size_t>> slice_of;  // (set, frame) in its camera's data
};

void index_camera(const H5Group& detector, const std::string& camera, FrameIndex& index) {
  const auto status = detector.read_texts("status");
  if (status.size() != index.sets.size())
    throw H5Failure(concat("the status of camera ", camera, " is cut short"));
  const auto count = static_cast<std::size_t>(std::count(status.begin(), status.end(), kStored));
  auto frames = read_camera_frames(detector, camera, count);
  std::size_t next = 0;
  for (std::size_t s = 0; s < index.sets.size(); ++s) {
    if (status[s] == kStored) {
      index.slice_of[s].push_back(next);
      index.sets[s].frames.push_back(std::move(frames[next++]));
    } else if (status[s] != kAbsent) {
      const auto cause = loss_cause_from_name(status[s]);
      if (!cause) throw H5Failure(concat("unknown status '", status[s], "' of camera ", camera));
      index.sets[s].losses.push_back({camera, *cause});
    }
  }
}

FrameIndex index_of(const H5File& file) {
  const H5Group entry = file.group("entry");
  FrameIndex index;
  index.sets = read_sets(entry.group("sets"));
  index.slice_of.resize(index.sets.size());
  const H5Group instrument = entry.group("instrument");
  for (const std::string& camera : instrument.names()) index_camera(instrument.group(camera), camera, index);
  return index;
}

}  // namespace

Result<> write_frames(const std::filesystem::path& path, const std::vector<FrameSet>& sets,
                      const Provenance& provenance) {
  auto cameras = by_camera(sets);
  if (!cameras) return tl::unexpected(cameras.error());
  return write_h5(path, [&](H5File& file) -> Result<> {
    file.set_text("default", "entry");
    H5Group entry = file.create_group("entry", "NXentry");
    write_sets(entry, sets);
    H5Group instrument = entry.create_group("instrument", "NXinstrument");
    for (const auto& [name, record] : *cameras) {
      if (auto ok = write_camera(instrument, name, record); !ok) return ok;
    }
    write_provenance(entry, provenance);
    return {};
  });
}

struct FrameReader::Impl {
  std::filesystem::path path;
  H5File file;
  FrameIndex index;
};

FrameReader::FrameReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
FrameReader::FrameReader(FrameReader&&) noexcept = default;
FrameReader::~FrameReader() = default;

Result<FrameReader> FrameReader::open(const std::filesystem::path& path) {
  if (auto found = open_input(path); !found) return tl::unexpected(found.error());
  return h5_result(path, "read", [&]() -> Result<FrameReader> {
    H5File file = H5File::open(path);
    FrameIndex index = index_of(file);
    return FrameReader(std::make_unique<Impl>(Impl{path, std::move(file), std::move(index)}));
  });
}

std::size_t FrameReader::sets() const {
  return impl_->index.sets.size();
}

Result<FrameSet> FrameReader::read(std::size_t index) const {
  expect(index < sets(), "the recording has this set");
  return h5_result(impl_->path, "read", [&]() -> Result<FrameSet> {
    FrameSet set = impl_->index.sets[index];
    const H5Group instrument = impl_->file.group("entry").group("instrument");
    for (std::size_t i = 0; i < set.frames.size(); ++i) {
      read_pixels(instrument.group(set.frames[i].camera), impl_->index.slice_of[index][i], set.frames[i]);
    }
    return set;
  });
}

Result<std::vector<FrameSet>> read_frames(const std::filesystem::path& path) {
  const auto reader = FrameReader::open(path);
  if (!reader) return tl::unexpected(reader.error());
  std::vector<FrameSet> sets;
  for (std::size_t i = 0; i < reader->sets(); ++i) {
    auto set = reader->read(i);
    if (!set) return tl::unexpected(set.error());
    sets.push_back(std::move(*set));
  }
  return sets;
}

}  // namespace flamefield
