#include "reconstruct/input_checks.h"

#include <algorithm>
#include <cmath>

#include "reconstruct/vectors.h"

namespace flamefield {

Result<> check_views(const Projections& p, const Projector& projector) {
  if (p.rows != projector.rows() || p.cols != projector.cols() ||
      p.values.size() != p.views() * p.pixels_per_view()) {
    return invalid_input(concat("projections of ", p.views(), " views with ", p.rows, "x", p.cols,
                                " (rows x cols), ", p.values.size(), " values"),
                         concat("the rig's images have ", projector.rows(), "x", projector.cols(), ", ",
                                projector.views(), " views"),
                         "use the rig that prepare wrote for these projections");
  }
  if (p.view_names != projector.view_names()) {
    std::size_t v = 0;
    while (v < std::min(p.views(), projector.views()) && p.view_names[v] == projector.view_names()[v]) ++v;
    const auto at = [v](const std::vector<std::string>& names) {
      return v < names.size() ? names[v] : std::string("missing");
    };
    return invalid_input(concat("view ", v, " is ", at(p.view_names), " in the projections, ",
                                at(projector.view_names()), " in the rig"),
                         "each view needs its camera, in the rig's order", "check rig and projections");
  }
  for (std::size_t i = 0; i < p.values.size(); ++i) {
    if (std::isfinite(p.values[i])) continue;
    const std::size_t in_view = i % p.pixels_per_view(), cols = static_cast<std::size_t>(p.cols);
    return invalid_input(
        concat("projections: ", p.values[i], " in view ", p.view_names[i / p.pixels_per_view()], ", row ",
               in_view / cols, ", column ", in_view % cols),
        "every value must be finite", "mask or repair this pixel");
  }
  return {};
}

Result<> check_sight(const Projector& projector, Team& team) {
  const Layout& layout = projector.layout();
  std::vector<float> images(layout.pixels());
  projector.forward(team, even_volume(layout), images);
  for (std::size_t v = 0; v < projector.views(); ++v) {
    const auto view = std::span(images).subspan(v * layout.pixels_per_view(), layout.pixels_per_view());
    if (std::ranges::any_of(view, [](float length_mm) { return length_mm > 0; })) continue;
    const Eigen::Vector3d low = projector.grid().lower_mm(), high = projector.grid().upper_mm();
    return invalid_input(concat("camera ", projector.view_names()[v], " does not see the domain"),
                         concat("none of its rays meets the box from (", low.x(), ", ", low.y(), ", ",
                                low.z(), ") to (", high.x(), ", ", high.y(), ", ", high.z(), ") mm"),
                         "check the rig, the size, spacing and origin of the domain");
  }
  return {};
}

Result<> check_start(const Volume& start, const Grid& grid) {
  const Grid& given = start.grid;
  if (!(given == grid) || start.values.size() != grid.voxels()) {
    const auto text = [](const Grid& g) {
      return concat(g.nx, "x", g.ny, "x", g.nz, " voxels of ", g.spacing_mm.x(), "x", g.spacing_mm.y(), "x",
                    g.spacing_mm.z(), " mm from (", g.origin_mm.x(), ", ", g.origin_mm.y(), ", ",
                    g.origin_mm.z(), ") mm");
    };
    return invalid_input(concat("the warm start has ", text(given)), concat("the domain has ", text(grid)),
                         "start from a volume of the same size, spacing and origin");
  }
  for (std::size_t i = 0; i < grid.voxels(); ++i) {
    if (!std::isfinite(start.values[i]))
      return invalid_input(concat("the warm start: ", start.values[i], " at voxel ", i),
                           "every value must be finite", "start from another volume");
  }
  return {};
}

std::vector<std::string> notes_about(const Projections& projections) {
  const float brightest = *std::ranges::max_element(projections.values);
  if (!(brightest > 0)) return {};
  std::size_t at_top = 0, near_top = 0;
  for (const float v : projections.values) {
    if (v == brightest)
      ++at_top;
    else if (v >= 0.9f * brightest)
      ++near_top;
  }
  constexpr double kShare = 1e-3;
  if (static_cast<double>(at_top) < kShare * static_cast<double>(projections.values.size()) ||
      at_top <= near_top)
    return {};
  return {concat(at_top, " pixels share the brightest value ", brightest,
                 ": the images may be saturated, and the field too dim there")};
}

}  // namespace flamefield
