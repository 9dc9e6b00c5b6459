#include <cmath>
#include <opencv2/core.hpp>
#include <sstream>

#include "proto/job.h"
#include "services/store/file.h"
#include "services/store/rig_export.h"

namespace flamefield {

namespace {

constexpr double kMmPerMetre = 1e3;

// What is wrong with a camera chain; becomes an Error in read_kalibr.
struct ChainProblem {
  std::string where, why;
};

// Errors come back as exceptions; without this the library also prints them.
int be_silent(int, const char*, const char*, const char*, int, void*) {
  return 0;
}

// YAML lets "- " stand right below its key, and Kalibr does; OpenCV wants it further in.
std::string with_indented_rows(const std::string& text) {
  std::string out;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t begin = line.find_first_not_of(' ');
    if (begin != std::string::npos && line.compare(begin, 2, "- ") == 0) out += "  ";
    out += line + '\n';
  }
  return out;
}

std::vector<double> numbers(const cv::FileNode& node, std::size_t count, const std::string& where) {
  if (!node.isSeq() || node.size() != count)
    throw ChainProblem{where, concat("not a list of ", count, " numbers")};
  std::vector<double> out;
  for (const cv::FileNode& element : node) {
    if (!element.isReal() && !element.isInt()) throw ChainProblem{where, "not a number"};
    out.push_back(element.real());
  }
  return out;
}

void expect_text(const cv::FileNode& node, const std::string& wanted, const std::string& where) {
  if (!node.isString() || node.string() != wanted)
    throw ChainProblem{where, concat("only '", wanted, "' is understood")};
}

// "/cam00/image_raw" names camera cam00.
std::string name_from(const cv::FileNode& topic, const std::string& otherwise) {
  if (!topic.isString()) return otherwise;
  const std::string text = topic.string();
  const std::size_t begin = text.find_first_not_of('/');
  if (begin == std::string::npos) return otherwise;
  const std::string name = text.substr(begin, text.find('/', begin) - begin);
  return is_file_safe(name) ? name : otherwise;
}

Rigid3 motion_from(const cv::FileNode& rows, const std::string& where) {
  if (!rows.isSeq() || rows.size() != 4) throw ChainProblem{where, "not a 4x4 matrix"};
  Rigid3 out;
  for (int i = 0; i < 3; ++i) {
    const std::vector<double> row = numbers(rows[i], 4, where);
    for (int j = 0; j < 3; ++j) out.rotation(i, j) = row[static_cast<std::size_t>(j)];
    out.translation_mm(i) = kMmPerMetre * row[3];
  }
  return out;
}

Camera camera_from(const cv::FileNode& node, const std::string& key) {
  Camera camera;
  camera.name = name_from(node["rostopic"], key);
  expect_text(node["camera_model"], "pinhole", concat(key, ".camera_model"));
  expect_text(node["distortion_model"], "radtan", concat(key, ".distortion_model"));
  const std::vector<double> k = numbers(node["intrinsics"], 4, concat(key, ".intrinsics")),
                            d = numbers(node["distortion_coeffs"], 4, concat(key, ".distortion_coeffs")),
                            size = numbers(node["resolution"], 2, concat(key, ".resolution"));
  camera.fx_px = k[0];
  camera.fy_px = k[1];
  camera.cx_px = k[2];
  camera.cy_px = k[3];
  std::copy(d.begin(), d.end(), camera.distortion.begin());
  camera.image_width_px = static_cast<int>(std::lround(size[0]));
  camera.image_height_px = static_cast<int>(std::lround(size[1]));
  return camera;
}

Rig chain_from(const cv::FileStorage& file) {
  Rig rig;
  for (int i = 0;; ++i) {
    const std::string key = concat("cam", i);
    const cv::FileNode node = file[key];
    if (node.empty()) break;
    Camera camera = camera_from(node, key);
    if (i > 0)
      camera.camera_from_world =
          motion_from(node["T_cn_cnm1"], concat(key, ".T_cn_cnm1")) * rig.cameras.back().camera_from_world;
    rig.cameras.push_back(std::move(camera));
  }
  if (rig.cameras.empty()) throw ChainProblem{"cam0", "it is missing"};
  return rig;
}

}  // namespace

Result<Rig> read_kalibr(const std::filesystem::path& path) {
  const auto text = read_text_file(path);
  if (!text) return tl::unexpected(text.error());
  const auto refuse = [&](const std::string& where, const std::string& why) {
    return invalid_input(concat(path.string(), ": ", where), why,
                         "give a camera chain as Kalibr writes it (camchain.yaml, pinhole-radtan)");
  };
  cv::redirectError(be_silent);
  const auto rig = [&]() -> Result<Rig> {
    try {
      // OpenCV's reader wants its own first line, and the elements of a sequence further in than its key.
      const std::string with_header =
          (text->starts_with("%YAML") ? "" : "%YAML:1.0\n---\n") + with_indented_rows(*text);
      const cv::FileStorage file(
          with_header, cv::FileStorage::READ | cv::FileStorage::MEMORY | cv::FileStorage::FORMAT_YAML);
      return chain_from(file);
    } catch (const ChainProblem& problem) {
      return refuse(problem.where, problem.why);
    } catch (const cv::Exception& problem) {
      return refuse("not such a file", problem.err);
    }
  }();
  if (!rig) return rig;
  if (auto ok = validate(*rig); !ok) return refuse("not a rig", ok.error().message);
  return rig;
}

}  // namespace flamefield
