// Recordings in parts become one file; recordings become pictures.
#include <algorithm>
#include <fstream>
#include <map>
#include <set>

#include <opencv2/imgcodecs.hpp>

#include "services/store/file.h"
#include "services/store/frame_file.h"
#include "services/store/h5_output.h"

namespace flamefield {

namespace fs = std::filesystem;

namespace {

constexpr const char* kSetTexts[] = {"capture", "kind"};
constexpr const char* kSetNumbers[] = {"image_key", "pulse", "index", "pulse_time_ns", "complete_time_ns"};
constexpr const char* kFrameNumbers[] = {"pulse", "device_time_ns", "arrival_time_ns", "exposure_us"};

template <class T>
void append(std::vector<T>& to, const std::vector<T>& more) {
  to.insert(to.end(), more.begin(), more.end());
}

std::vector<std::int64_t> numbers_of(const H5Group& group, const std::string& name) {
  H5Shape shape;
  return group.read<std::int64_t>(name, shape);
}

void merge_sets(const std::vector<H5Group>& entries, H5Group& out) {
  H5Group table = out.create_group("sets", "NXcollection");
  for (const char* name : kSetTexts) {
    std::vector<std::string> all;
    for (const H5Group& entry : entries) append(all, entry.group("sets").read_texts(name));
    table.write_texts(name, all);
  }
  for (const char* name : kSetNumbers) {
    std::vector<std::int64_t> all;
    for (const H5Group& entry : entries) append(all, numbers_of(entry.group("sets"), name));
    table.write<std::int64_t>(name, all, {all.size()});
  }
}

void merge_camera(const std::vector<H5Group>& entries, const std::string& camera, H5Group& instrument) {
  H5Group out = instrument.create_group(camera, "NXdetector");
  std::vector<std::string> status;
  std::map<std::string, std::vector<std::int64_t>> columns;
  H5Shape shape;
  std::string format;
  std::vector<H5Group> parts;  // that have pictures of it
  for (const H5Group& entry : entries) {
    const H5Group all = entry.group("instrument");
    if (!all.has(camera)) {
      status.resize(status.size() + entry.group("sets").read_texts("capture").size(), "absent");
      continue;
    }
    H5Group part = all.group(camera);
    append(status, part.read_texts("status"));
    for (const char* name : kFrameNumbers) append(columns[name], numbers_of(part, name));
    if (!part.has("data")) continue;
    const H5Shape own = part.checked_shape("data");
    const std::string own_format = part.text_of_dataset("data", "pixel_format");
    if (shape.empty()) shape = {0, own.at(1), own.at(2)}, format = own_format;
    if (own.at(1) != shape[1] || own.at(2) != shape[2] || own_format != format) {
      throw H5Failure(concat("the frames of camera ", camera, " change their size or format"));
    }
    shape[0] += own[0];
    parts.push_back(std::move(part));
  }
  out.write_texts("status", status);
  for (const auto& [name, values] : columns) out.write<std::int64_t>(name, values, {values.size()});
  if (shape.empty()) return;
  const auto pixel_format = pixel_format_from_name(format);
  if (!pixel_format) throw H5Failure(concat("unknown pixel format '", format, "'"));
  const H5Number number = bits_of(*pixel_format) == 8 ? H5Number::U8 : H5Number::U16;
  out.create("data", number, shape, H5Layout::Zipped);
  out.set_text("pixel_format", format, "data");
  std::vector<std::uint16_t> pixels(shape[1] * shape[2]);
  std::size_t next = 0;
  for (const H5Group& part : parts) {
    const std::size_t count = part.checked_shape("data")[0];
    for (std::size_t i = 0; i < count; ++i) {
      part.read_slice("data", i, number, pixels.data());
      out.write_slice("data", next++, number, pixels.data());
    }
  }
}

Result<> write_tiff(const fs::path& path, const Frame& frame) {
  const auto image = grey_levels(frame);
  if (!image) return tl::unexpected(image.error());
  const bool is_narrow = bits_of(frame.format) == 8;
  cv::Mat mat;
  cv::Mat(image->height_px, image->width_px, CV_32F, const_cast<float*>(image->pixels.data()))
      .convertTo(mat, is_narrow ? CV_8U : CV_16U);
  try {
    if (cv::imwrite(path.string(), mat)) return {};
  } catch (const cv::Exception&) {  // said below
  }
  return unavailable(concat("cannot write '", path.string(), "'"), "the disk is full or not writable",
                     "free space or choose another folder");
}

}  // namespace

Result<> merge_frame_files(const std::vector<fs::path>& parts, const fs::path& path,
                           const Provenance& provenance) {
  return write_h5(path, [&](H5File& out) -> Result<> {
    std::vector<H5File> files;
    std::vector<H5Group> entries;
    std::set<std::string> cameras;
    for (const fs::path& part : parts) {
      files.push_back(H5File::open(part));
      entries.push_back(files.back().group("entry"));
      const auto names = entries.back().group("instrument").names();
      cameras.insert(names.begin(), names.end());
    }
    out.set_text("default", "entry");
    H5Group entry = out.create_group("entry", "NXentry");
    merge_sets(entries, entry);
    H5Group instrument = entry.create_group("instrument", "NXinstrument");
    for (const std::string& camera : cameras) merge_camera(entries, camera, instrument);
    write_provenance(entry, provenance);
    return {};
  });
}

Result<> write_frame_tiffs(const fs::path& folder, const FrameReader& recording) {
  std::error_code problem;
  std::string table = "capture,index,pulse,pulse_time_ns,camera,status\n";
  for (std::size_t i = 0; i < recording.sets(); ++i) {
    const auto set = recording.read(i);
    if (!set) return tl::unexpected(set.error());
    const std::string row =
        concat(set->capture, ",", set->index, ",", set->pulse, ",", set->pulse_time_ns, ",");
    for (const Frame& frame : set->frames) {
      fs::create_directories(folder / frame.camera, problem);
      std::string number = std::to_string(set->index);
      if (number.size() < 6) number.insert(0, 6 - number.size(), '0');
      const fs::path file = folder / frame.camera / concat(set->capture, "-", number, ".tif");
      if (auto ok = write_tiff(file, frame); !ok) return ok;
      table += concat(row, frame.camera, ",stored\n");
    }
    for (const FrameLoss& loss : set->losses)
      table += concat(row, loss.camera, ",", name_of(loss.cause), "\n");
  }
  fs::create_directories(folder, problem);
  return write_text_file(folder / "sets.csv", table);
}

}  // namespace flamefield
