#include "reconstruct/prepare.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>
#include <numeric>

#include "proto/check.h"
#include "reconstruct/sensor_crop.h"
#include "reconstruct/virtual_camera.h"

namespace flamefield {

namespace {

constexpr int kBorder_px = 2;  // read around the used pixels, so that repairs and medians have neighbours

// An exponent of all ones is NaN or infinity; integers are compared many at a time.
bool is_finite(const std::vector<float>& values) {
  constexpr std::uint32_t kExponent = 0x7f800000;
  std::uint32_t largest = 0;
  for (float v : values) largest = std::max(largest, std::bit_cast<std::uint32_t>(v) & kExponent);
  return largest != kExponent;
}

Result<const Image*> image_of(const CameraImages& images, std::string_view what, const Camera& camera) {
  const auto found = images.find(camera.name);
  if (found == images.end()) {
    return invalid_input(concat("no ", what, " image of camera ", camera.name),
                         concat("other cameras have one"),
                         concat("capture ", what, " again with all cameras"));
  }
  const Image& image = found->second;
  if (image.width_px != camera.image_width_px || image.height_px != camera.image_height_px) {
    return invalid_input(
        concat(what, " image of camera ", camera.name, " has ", image.width_px, "x", image.height_px, " px"),
        concat("the rig says ", camera.image_width_px, "x", camera.image_height_px),
        "use the rig of this array, without cropping");
  }
  if (is_finite(image.pixels)) return &image;
  const auto bad = std::ranges::find_if(image.pixels, [](float v) { return !std::isfinite(v); });
  const auto i = bad - image.pixels.begin();
  return invalid_input(concat(what, " image of camera ", camera.name, ": ", *bad, " at row ",
                              i / image.width_px, ", column ", i % image.width_px),
                       "every value must be finite", "capture it again");
}

// The same, or none when there are no images of this kind at all.
Result<const Image*> reference_of(const MeanImages& images, std::string_view what, const Camera& camera) {
  if (images.empty()) return nullptr;
  return image_of(images.images, what, camera);
}

struct Rectangle {
  int x0 = 0, y0 = 0, cols = 0, rows = 0;
  int area() const { return cols * rows; }
};

// The largest rectangle of pixels that are wholly on the sensor (heights of columns of ones, row by row).
Rectangle largest_inside(const AreaMap& map) {
  Rectangle best;
  std::vector<int> height(static_cast<std::size_t>(map.cols), 0);
  for (int row = 0; row < map.rows; ++row) {
    for (int col = 0; col < map.cols; ++col) {
      int& h = height[static_cast<std::size_t>(col)];
      h = map.is_inside[static_cast<std::size_t>(row * map.cols + col)] ? h + 1 : 0;
    }
    for (int left = 0; left < map.cols; ++left) {
      int lowest = map.rows;
      for (int col = left; col < map.cols; ++col) {
        lowest = std::min(lowest, height[static_cast<std::size_t>(col)]);
        const Rectangle here{left, row - lowest + 1, col - left + 1, lowest};
        if (here.area() > best.area()) best = here;
      }
    }
  }
  return best;
}

std::string saturation_line(const Projections& projections, const std::vector<std::size_t>& saturated) {
  std::string list;
  for (std::size_t v = 0; v < saturated.size(); ++v) {
    if (saturated[v] == 0) continue;
    list += concat(list.empty() ? "" : ", ", projections.view_names[v], " ", saturated[v]);
  }
  return list.empty() ? std::string("saturated pixels: none")
                      : concat("saturated pixels, too dark in the result: ", list);
}

// Total emission is what every camera sees of the same flame: I summed over the pixel's area at the domain.
std::string equalise(Projections& projections, const Rig& rig, const Grid& domain) {
  const Eigen::Vector3d centre = 0.5 * (domain.lower_mm() + domain.upper_mm());
  std::vector<double> totals;
  for (std::size_t v = 0; v < projections.views(); ++v) {
    const Camera& c = rig.cameras[v];
    const double depth_mm = (c.camera_from_world * centre).z();
    const auto view = projections.view(v);
    totals.push_back(std::accumulate(view.begin(), view.end(), 0.0) * depth_mm * depth_mm / c.fx_px /
                     c.fy_px);
  }
  const double mean = std::accumulate(totals.begin(), totals.end(), 0.0) / static_cast<double>(totals.size());
  double low = INFINITY, high = 0;
  for (std::size_t v = 0; v < projections.views(); ++v) {
    if (!(totals[v] > 0 && mean > 0)) continue;
    const double factor = mean / totals[v];
    low = std::min(low, factor), high = std::max(high, factor);
    for (float& p : projections.view(v)) p = static_cast<float>(p * factor);
  }
  return concat("views scaled to one total emission, by ", low, " to ", high);
}

}  // namespace

Result<Rig> rig_of_images(const Rig& rig, const CameraImages& flame) {
  if (flame.empty()) return invalid_input("no flame images", "nothing to prepare", "capture a burst first");
  for (const auto& [name, image] : flame) {
    if (!rig.find(name)) {
      return invalid_input(concat("camera ", name, " is not in the rig"), "its pose is unknown",
                           "calibrate it or leave its images out");
    }
  }
  Rig out;
  for (const Camera& camera : rig.cameras)
    if (flame.contains(camera.name)) out.cameras.push_back(camera);
  return out;
}

Result<Preparer> Preparer::make(const Rig& rig, const References& references, const Grid& domain,
                                const PrepareOptions& options, Team& team) {
  if (auto ok = validate(rig); !ok) return tl::unexpected(ok.error());
  if (auto ok = validate(domain); !ok) return tl::unexpected(ok.error());
  struct Found {
    const Image *dark, *background, *flat;
  };
  std::vector<Found> found;
  for (const Camera& camera : rig.cameras) {
    const auto dark = reference_of(references.dark, "dark", camera);
    if (!dark) return tl::unexpected(dark.error());
    const auto background = reference_of(references.background, "background", camera);
    if (!background) return tl::unexpected(background.error());
    const auto flat = reference_of(references.flat, "flat", camera);
    if (!flat) return tl::unexpected(flat.error());
    found.push_back({*dark, *background, *flat});
  }
  Preparer out;
  out.options_ = options;
  out.domain_ = domain;
  const auto made =
      options.level ? out.make_level(rig.cameras, domain, team) : out.make_crops(rig.cameras, domain);
  if (!made) return tl::unexpected(made.error());
  team.run(out.views_.size(), [&](std::size_t v) {
    View& view = out.views_[v];
    view.correction.emplace_back(view.map.window, found[v].dark, found[v].background, found[v].flat,
                                 options.hot_pixel_sigma);
  });
  out.describe_references(references);
  return out;
}

Result<> Preparer::make_level(const std::vector<Camera>& sensors, const Grid& domain, Team& team) {
  const auto made = virtual_cameras(sensors, domain, options_.binning, options_.margin_px);
  if (!made) return tl::unexpected(made.error());
  views_.resize(sensors.size());
  team.run(sensors.size(), [&](std::size_t v) {
    views_[v] = {sensors[v], made->cameras[v], area_map(sensors[v], made->cameras[v], kBorder_px), {}};
  });
  if (auto ok = shrink_to_sensors(); !ok) return ok;
  const AreaMap& map = views_.front().map;
  geometry_.insert(geometry_.begin(),
                   concat("resampled by area into level cameras: ", map.cols, "x", map.rows, " px of ",
                          made->pixel_mm, " mm at the domain's centre (", made->sensor_px_per_pixel,
                          " sensor pixels wide); distortion removed, turned by at most ",
                          made->largest_turn_rad * 180 / std::numbers::pi, " deg; views: ", sensors.size()));
  for (const std::string& name : made->not_level)
    geometry_.push_back(concat("camera ", name, " looks too steeply to be levelled: only undistorted"));
  return {};
}

Result<> Preparer::shrink_to_sensors() {
  const int cols = views_.front().map.cols, rows = views_.front().map.rows;
  int new_cols = cols, new_rows = rows;
  std::vector<Rectangle> inside;
  for (const View& view : views_) {
    inside.push_back(largest_inside(view.map));
    if (inside.back().area() == 0) {
      return invalid_input(concat("camera ", view.sensor.name, " does not see the domain"),
                           "not one pixel of its image of it is on the sensor",
                           "check the rig and the domain, or leave this camera out");
    }
    new_cols = std::min(new_cols, inside.back().cols);
    new_rows = std::min(new_rows, inside.back().rows);
  }
  if (new_cols == cols && new_rows == rows) return {};
  std::string who;
  for (std::size_t v = 0; v < views_.size(); ++v) {
    View& view = views_[v];
    const Rectangle& r = inside[v];
    if (r.area() < cols * rows) who += concat(who.empty() ? "" : ", ", view.sensor.name);
    const int x0 = std::clamp((cols - new_cols) / 2, r.x0, r.x0 + r.cols - new_cols);
    const int y0 = std::clamp((rows - new_rows) / 2, r.y0, r.y0 + r.rows - new_rows);
    view.map = cropped(view.map, x0, y0, new_cols, new_rows);
    view.camera = cropped_and_binned(view.camera, x0, y0, new_cols, new_rows, 1);
  }
  geometry_.push_back(concat("all views cut from ", cols, "x", rows, " to ", new_cols, "x", new_rows,
                             " px: the domain leaves the sensors of ", who));
  return {};
}

Result<> Preparer::make_crops(const std::vector<Camera>& sensors, const Grid& domain) {
  const auto crops = sensor_crops(sensors, domain, options_.binning, options_.margin_px);
  if (!crops) return tl::unexpected(crops.error());
  for (std::size_t v = 0; v < sensors.size(); ++v)
    views_.push_back({sensors[v], crops->cameras[v], block_map(crops->windows[v], crops->binning), {}});
  const AreaMap& map = views_.front().map;
  geometry_.push_back(concat("cut to ", map.window.width, "x", map.window.height,
                             " px around the domain, margin ", options_.margin_px,
                             " px; views: ", sensors.size()));
  geometry_.push_back(
      concat("merged ", crops->binning, "x", crops->binning, " px by area to ", map.cols, "x", map.rows));
  return {};
}

std::size_t Preparer::saturated_in(const MeanImages& images, const View& view) {
  const auto found = images.saturated.find(view.sensor.name);
  if (found == images.saturated.end()) return 0;
  return view.correction.front().count_used(found->second, view.sensor.image_width_px);
}

void Preparer::describe_references(const References& references) {
  const auto mean_of = [](const MeanImages& images) {
    return images.sets > 0 ? concat(", mean of ", images.sets) : std::string();
  };
  if (!references.background.empty()) {
    corrections_.push_back(
        concat("background subtracted (it contains the dark level)", mean_of(references.background)));
  } else if (!references.dark.empty()) {
    corrections_.push_back(concat("dark subtracted", mean_of(references.dark)));
  }
  if (!references.flat.empty()) {
    corrections_.push_back(concat("divided by the flat field", mean_of(references.flat),
                                  ", its mean over the used window set to 1"));
    std::size_t saturated = 0;
    for (const View& view : views_) saturated += saturated_in(references.flat, view);
    if (saturated > 0)
      corrections_.push_back(
          concat("saturated pixels in the flat field: ", saturated, "; expose it shorter"));
  }
  if (references.dark.empty()) return;
  std::size_t hot = 0;
  for (const View& view : views_) hot += view.correction.front().hot_pixels();
  corrections_.push_back(concat("hot pixels: ", hot, " repaired (dark level beyond ",
                                options_.hot_pixel_sigma, " robust deviations), median of their neighbours"));
}

Image Preparer::corrected(std::size_t view, const Image& raw) const {
  const Window& window = views_.at(view).map.window;
  Image out(window.width, window.height);
  out.pixels = views_.at(view).correction.front().apply(raw);
  return out;
}

Result<Prepared> Preparer::operator()(const MeanImages& flame, Team& team) const {
  std::vector<const Image*> raw;
  for (const View& view : views_) {
    const auto image = image_of(flame.images, "flame", view.sensor);
    if (!image) return tl::unexpected(image.error());
    raw.push_back(*image);
  }
  Prepared out;
  Projections& projections = out.projections;
  projections.rows = views_.front().map.rows;
  projections.cols = views_.front().map.cols;
  projections.values.resize(views_.size() * projections.pixels_per_view());
  for (const View& view : views_) {
    projections.view_names.push_back(view.camera.name);
    out.rig.cameras.push_back(view.camera);
  }
  std::vector<std::ptrdiff_t> clipped(views_.size());
  out.saturated.resize(views_.size());
  const auto scale = static_cast<float>(1 / options_.counts_per_unit);
  team.run(views_.size(), [&](std::size_t v) {
    const View& view = views_[v];
    const Image image = view.map.apply(view.correction.front().apply(*raw[v]));
    std::ranges::transform(image.pixels, projections.view(v).begin(), [&](float p) { return p * scale; });
    if (options_.clip_negative) {
      clipped[v] = std::ranges::count_if(projections.view(v), [](float p) { return p < 0; });
      for (float& p : projections.view(v)) p = std::max(p, 0.0f);
    }
    out.saturated[v] = saturated_in(flame, view);
  });
  if (flame.sets > 0) out.provenance.push_back(concat("flame images: mean of ", flame.sets, " frame sets"));
  out.provenance.push_back(saturation_line(projections, out.saturated));
  out.provenance.insert(out.provenance.end(), corrections_.begin(), corrections_.end());
  out.provenance.insert(out.provenance.end(), geometry_.begin(), geometry_.end());
  out.provenance.push_back(
      concat("divided by ", options_.counts_per_unit, " grey levels per (field unit x mm)"));
  if (options_.clip_negative) {
    out.provenance.push_back(concat(
        "negative values set to zero: ", std::accumulate(clipped.begin(), clipped.end(), std::ptrdiff_t{0}),
        " pixels"));
  }
  if (options_.equal_views) out.provenance.push_back(equalise(projections, out.rig, domain_));
  return out;
}

Result<Prepared> prepare(const MeanImages& flame, const References& references, const Rig& rig,
                         const Grid& domain, const PrepareOptions& options) {
  if (auto ok = validate(rig); !ok) return tl::unexpected(ok.error());
  const auto cameras = rig_of_images(rig, flame.images);
  if (!cameras) return tl::unexpected(cameras.error());
  Team team;
  const auto preparer = Preparer::make(*cameras, references, domain, options, team);
  if (!preparer) return tl::unexpected(preparer.error());
  return (*preparer)(flame, team);
}

}  // namespace flamefield
