#include "services/store/rig_file.h"

#include <cmath>
#include <opencv2/core.hpp>

#include "services/store/file.h"

namespace flamefield {

namespace {

constexpr const char* kFormat = "flamefield-rig-1";

// What is wrong with a rig file; becomes an Error in read_rig.
struct RigProblem {
  std::string where;
  std::string why;
};

// Errors come back as exceptions; without this the library also prints them.
int be_silent(int, const char*, const char*, const char*, int, void*) {
  return 0;
}

double real(const cv::FileNode& node, const std::string& where) {
  if (!node.isReal() && !node.isInt())
    throw RigProblem{where, node.empty() ? "it is missing" : "not a number"};
  return node.real();
}

int whole(const cv::FileNode& node, const std::string& where) {
  const double value = real(node, where);
  if (value != std::floor(value) || std::abs(value) > 1e9) throw RigProblem{where, "not a whole number"};
  return static_cast<int>(value);
}

// Elements of a matrix, row by row. Read without cv::Mat, which would allocate whatever a damaged file says.
std::vector<double> matrix(const cv::FileNode& node, std::size_t rows, std::size_t cols,
                           const std::string& where) {
  if (node.empty()) throw RigProblem{where, "it is missing"};
  if (!node.isMap()) throw RigProblem{where, "not a matrix"};
  const cv::FileNode data = node["data"];
  if (whole(node["rows"], where) != static_cast<int>(rows) ||
      whole(node["cols"], where) != static_cast<int>(cols) || !data.isSeq() || data.size() != rows * cols) {
    throw RigProblem{where, concat("not a ", rows, "x", cols, " matrix")};
  }
  std::vector<double> values;
  for (const cv::FileNode& element : data) values.push_back(real(element, where));
  return values;
}

std::vector<double> distortion(const cv::FileNode& node, const std::string& where) {
  if (node.empty()) return std::vector<double>(5, 0.0);
  const bool is_column = node.isMap() && whole(node["rows"], where) == 5;  // OpenCV users write both
  return matrix(node, is_column ? 5 : 1, is_column ? 1 : 5, where);
}

Camera read_camera(const cv::FileNode& node, std::size_t index) {
  Camera camera;
  if (!node.isMap() || !node["name"].isString())
    throw RigProblem{concat("name of camera ", index), "it is missing"};
  camera.name = node["name"].string();
  const auto where = [&](std::string_view field) { return concat(field, " of camera '", camera.name, "'"); };
  camera.image_width_px = whole(node["image_width"], where("image_width"));
  camera.image_height_px = whole(node["image_height"], where("image_height"));
  const auto k = matrix(node["camera_matrix"], 3, 3, where("camera_matrix"));
  if (k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1)
    throw RigProblem{where("camera_matrix"), "only [fx 0 cx; 0 fy cy; 0 0 1] is supported"};
  camera.fx_px = k[0];
  camera.cx_px = k[2];
  camera.fy_px = k[4];
  camera.cy_px = k[5];
  const auto d = distortion(node["distortion_coefficients"], where("distortion_coefficients"));
  std::copy(d.begin(), d.end(), camera.distortion.begin());
  const auto pose = matrix(node["camera_from_world"], 3, 4, where("camera_from_world"));
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col)
      camera.camera_from_world.rotation(row, col) = pose[static_cast<std::size_t>(4 * row + col)];
    camera.camera_from_world.translation_mm[row] = pose[static_cast<std::size_t>(4 * row + 3)];
  }
  return camera;
}

RigQuality read_quality(const cv::FileNode& node) {
  RigQuality quality;
  quality.rms_px = real(node["rms_px"], "quality.rms_px");
  quality.board_poses = whole(node["board_poses"], "quality.board_poses");
  for (const cv::FileNode& c : node["cameras"]) {
    const auto where = [&](std::string_view field) {
      return concat("quality.cameras[", quality.cameras.size(), "].", field);
    };
    CameraQuality camera;
    camera.images = whole(c["images"], where("images"));
    camera.corners = whole(c["corners"], where("corners"));
    camera.rejected_corners = whole(c["rejected_corners"], where("rejected_corners"));
    camera.rms_px = real(c["rms_px"], where("rms_px"));
    camera.focal_sigma_px = real(c["focal_sigma_px"], where("focal_sigma_px"));
    camera.position_sigma_mm = real(c["position_sigma_mm"], where("position_sigma_mm"));
    camera.rotation_sigma_rad = real(c["rotation_sigma_rad"], where("rotation_sigma_rad"));
    quality.cameras.push_back(camera);
  }
  return quality;
}

Rig parse(const std::string& text) {
  cv::FileStorage storage(text,
                          cv::FileStorage::READ | cv::FileStorage::MEMORY | cv::FileStorage::FORMAT_YAML);
  if (!storage.isOpened()) throw RigProblem{"the file", "not an OpenCV YAML file"};
  if (!storage["format"].isString() || storage["format"].string() != kFormat)
    throw RigProblem{"format", concat("it is not '", kFormat, "'")};
  const cv::FileNode cameras = storage["cameras"];
  if (!cameras.isSeq()) throw RigProblem{"cameras", "the list is missing"};
  Rig rig;
  for (const cv::FileNode& camera : cameras) rig.cameras.push_back(read_camera(camera, rig.cameras.size()));
  if (const cv::FileNode count = storage["camera_count"]; !count.empty()) {
    if (whole(count, "camera_count") != static_cast<int>(rig.cameras.size()))
      throw RigProblem{"cameras", concat("camera_count promises ", whole(count, "camera_count"), ", ",
                                         rig.cameras.size(), " are there: the file is cut short")};
  }
  if (const cv::FileNode quality = storage["quality"]; !quality.empty()) rig.quality = read_quality(quality);
  return rig;
}

void write_camera(cv::FileStorage& out, const Camera& c) {
  const cv::Matx33d k(c.fx_px, 0, c.cx_px, 0, c.fy_px, c.cy_px, 0, 0, 1);
  cv::Mat1d d(1, 5), pose(3, 4);
  for (int i = 0; i < 5; ++i) d(0, i) = c.distortion[static_cast<std::size_t>(i)];
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col) pose(row, col) = c.camera_from_world.rotation(row, col);
    pose(row, 3) = c.camera_from_world.translation_mm[row];
  }
  out << "{"
      << "name" << c.name << "image_width" << c.image_width_px << "image_height" << c.image_height_px
      << "camera_matrix" << cv::Mat(k) << "distortion_coefficients" << d << "camera_from_world" << pose
      << "}";
}

void write_quality(cv::FileStorage& out, const RigQuality& quality) {
  out << "quality"
      << "{"
      << "rms_px" << quality.rms_px << "board_poses" << quality.board_poses << "cameras"
      << "[";
  for (const CameraQuality& q : quality.cameras) {
    out << "{"
        << "images" << q.images << "corners" << q.corners << "rejected_corners" << q.rejected_corners
        << "rms_px" << q.rms_px << "focal_sigma_px" << q.focal_sigma_px << "position_sigma_mm"
        << q.position_sigma_mm << "rotation_sigma_rad" << q.rotation_sigma_rad << "}";
  }
  out << "]"
      << "}";
}

}  // namespace

Result<Rig> read_rig(const std::filesystem::path& path) {
  const auto refuse = [&](std::string_view problem, std::string_view why) {
    return invalid_input(concat("cannot read '", path.string(), "': ", problem), why,
                         "mend the file or calibrate again");
  };
  auto text = read_text_file(path);
  if (!text) return tl::unexpected(text.error());
  cv::redirectError(be_silent);
  try {
    Rig rig = parse(*text);
    if (auto ok = validate(rig); !ok) return refuse("the rig", ok.error().message);
    return rig;
  } catch (const RigProblem& problem) {
    return refuse(problem.where, problem.why);
  } catch (const cv::Exception& exception) {
    return refuse("not valid YAML", exception.err);
  }
}

Result<> write_rig(const std::filesystem::path& path, const Rig& rig) {
  if (auto ok = validate(rig); !ok) return ok;
  cv::redirectError(be_silent);
  try {
    cv::FileStorage out("rig.yaml",
                        cv::FileStorage::WRITE | cv::FileStorage::MEMORY | cv::FileStorage::FORMAT_YAML);
    out << "format" << kFormat << "camera_count" << static_cast<int>(rig.cameras.size());
    // Before the cameras, so that the last thing in the file is one that cannot be missing unnoticed.
    if (rig.quality) write_quality(out, *rig.quality);
    out << "cameras"
        << "[";
    for (const Camera& camera : rig.cameras) write_camera(out, camera);
    out << "]";
    return write_text_file(path, out.releaseAndGetString());
  } catch (const cv::Exception& exception) {
    return invalid_input(concat("cannot write '", path.string(), "'"), exception.err,
                         "check the cameras' names");
  }
}

}  // namespace flamefield
