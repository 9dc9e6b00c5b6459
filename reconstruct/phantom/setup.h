#pragma once

#include "proto/volume.h"
#include "reconstruct/phantom/phantom.h"
#include "reconstruct/ring.h"

namespace flamefield {

// How the paper saw a phantom: its grid and its ring of cameras (Sections 3.1 and 3.3 to 3.5). The article
// does not say how far away the cameras stood; distances here are about 4.4 times the width of a flame's box,
// and 300 mm for the canonical bodies.
struct PhantomSetup {
  int nx = 0, ny = 0, nz = 0;
  double spacing_mm = 1;
  int views = 0;
  double view_spacing_rad = 0;
  double radius_mm = 300;

  Grid grid() const { return centred_grid(nx, ny, nz, spacing_mm); }
  RingOptions ring() const { return {views, view_spacing_rad, radius_mm, 0, 0, 0}; }
};
PhantomSetup paper_setup(PhantomKind kind);

}  // namespace flamefield
