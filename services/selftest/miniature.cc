#include "services/selftest/miniature.h"

#include <algorithm>
#include <cmath>

#include "reconstruct/phantom/phantom.h"
#include "reconstruct/render.h"
#include "reconstruct/ring.h"

namespace flamefield {

Miniature::Miniature() {
  const Grid grid = centred_grid(10, 10, 10, 2.0);
  truth = make_phantom({.kind = PhantomKind::Gaussian}, grid);
  RingOptions ring;
  ring.views = 5;
  ring.spacing_rad = 0.628;
  ring.radius_mm = 200;
  ring.image_width_px = ring.image_height_px = 16;
  rig = make_ring(ring, grid).value();
  views = render(truth, rig, {}).value();
}

FrameSet Miniature::set(const std::string& capture, CaptureKind kind, std::int64_t index) const {
  FrameSet out;
  out.capture = capture;
  out.kind = kind;
  out.index = out.pulse = index;
  out.pulse_time_ns = 1'700'000'000'000'000'000 + index * 200'000'000;
  out.complete_time_ns = out.pulse_time_ns + 1'000'000;
  const double gain =
      kind == CaptureKind::Dark ? 0 : kCountsPerUnit * (1 + 0.001 * static_cast<double>(index));
  for (std::size_t v = 0; v < views.views(); ++v) {
    Frame frame;
    frame.camera = rig.cameras[v].name;
    frame.pulse = index;
    frame.width_px = views.cols;
    frame.height_px = views.rows;
    std::vector<std::byte> bytes;
    for (const float value : views.view(v))
      bytes.push_back(static_cast<std::byte>(std::lround(std::min(255.0, kDark + gain * value))));
    frame.bytes = std::make_shared<const std::vector<std::byte>>(std::move(bytes));
    out.frames.push_back(std::move(frame));
  }
  return out;
}

Processing Miniature::processing(int iterations) const {
  Processing p;
  p.rig_id = fingerprint(rig);
  p.recipe.solver = "mlem";
  p.recipe.settings = {{"mlem.max_iterations", std::int64_t{iterations}},
                       {"prepare.counts_per_unit", kCountsPerUnit},
                       {"prepare.binning", std::int64_t{1}}};
  p.grid = truth.grid;
  p.dark_capture = "dark";
  return p;
}

}  // namespace flamefield
