#include "reconstruct/projector/level_engine.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "proto/check.h"

namespace flamefield {

namespace {

constexpr std::size_t kTileFloats = 128 * 1024;  // of voxels: half of a second-level cache
// Planes of a patch, so that a first-level cache holds the voxel columns that neighbouring pixels share; and
// of a slab, if the columns are long.
struct Depth {
  std::size_t patch_floats;
  int slab;
};
constexpr Depth kForward{1024, 8}, kAdjoint{512, 4};
constexpr int kColumnsPerTask = 8;  // pixel columns, forward, where one tile is all

KernelScratch& scratch_for(const StripShape& shape) {
  thread_local KernelScratch scratch;
  scratch.fit(shape);
  return scratch;
}

// The run from its first to its last pixel column that meets what is asked for.
template <class Meets>
LevelView::Run narrowed(LevelView::Run run, const Meets& meets) {
  while (run.begin < run.end && !meets(run.begin)) ++run.begin;
  while (run.begin < run.end && !meets(run.end - 1)) --run.end;
  return run;
}

}  // namespace

std::string LevelEngine::obstacle(const std::vector<LevelView>& views) {
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (!views[v].in_front()) return concat("view ", v, " stands inside the measuring volume");
    if (views[v].largest_half() > kLargestHalfWidth) {
      return concat("a pixel of view ", v, " averages over ", 2 * views[v].largest_half(),
                    " voxels, more than ", 2 * kLargestHalfWidth);
    }
  }
  return {};
}

LevelEngine::LevelEngine(std::vector<LevelView> views, const Layout& layout)
    : views_(std::move(views)), layout_(layout), lengths_(layout.pixels(), 0.0f) {
  expect(obstacle(views_).empty(), "the views can be factorised");
  vectors_ = std::min(layout.nx, layout.nz) >= kFewestVectorColumns;
  for (const LevelView& view : views_) {
    vectors_ = vectors_ && view.smallest_m() >= kSmallestVectorM && view.largest_m() <= kLargestVectorM &&
               view.largest_half() <= kLargestVectorHalf;
  }
  for (std::size_t v = 0; v < views_.size(); ++v)
    for (int col = 0; col < layout.cols; ++col)
      for (int up = 0; up < layout.rows; ++up) {
        lengths_[line(v, col) + static_cast<std::size_t>(up)] = views_[v].length_mm(col, up);
      }
}

LevelEngine::Walk LevelEngine::walk(bool along_z, const Planes& held, std::size_t patch_floats,
                                    int slab) const {
  const std::size_t row = static_cast<std::size_t>(layout_.nx) * layout_.column;
  const LevelView::Run in_z{held.begin, held.end}, in_x{0, layout_.nx};
  Walk out{along_z, along_z ? in_z : in_x, along_z ? row : layout_.column, {}, 0, 0, 0, false, 0};
  out.is_parted = held.count() < layout_.nz;
  out.before = static_cast<std::size_t>(held.begin) * row;
  out.shape.ny = layout_.ny;
  out.shape.column = layout_.column;
  out.shape.others = along_z ? layout_.nx : layout_.nz;
  out.shape.begin = along_z ? in_x.begin : in_z.begin;
  out.shape.end = along_z ? in_x.end : in_z.end;
  out.shape.stride = along_z ? layout_.column : row;
  out.shape.rows = layout_.rows;
  out.shape.line = layout_.line;
  const auto deep = std::clamp<std::size_t>(patch_floats / layout_.column, 2, kPatch);
  out.patch = static_cast<int>(std::bit_floor(deep));
  out.slab = std::max(out.patch, slab);
  const auto tile = static_cast<int>(kTileFloats / (static_cast<std::size_t>(out.slab) * layout_.column));
  // The last tile is no smaller than the kernels want.
  out.tile = std::max(tile, 4 * kFewestVectorColumns);
  while (out.tiles() > 1 && out.others() % out.tile != 0 && out.others() % out.tile < kFewestVectorColumns)
    ++out.tile;
  return out;
}

StripShape LevelEngine::Walk::seen_by(const LevelView& view) const {
  StripShape out = shape;
  out.height = view.height();
  out.axis_up = view.axis_up();
  return out;
}

StripPatch LevelEngine::patch(const Walk& w, std::size_t view, int col, int cols, int plane, int planes,
                              LevelView::Strips& strips) const {
  StripPatch out = views_[view].patch(col, cols, plane, planes, strips);
  // May wrap around; with a voxel column that is held, it comes back.
  out.plane = static_cast<std::size_t>(plane) * w.plane_stride - w.before;
  out.plane_step = w.plane_stride;
  out.line = line(view, col);
  out.line_step = layout_.line;
  return out;
}

// visit(col, cols, plane, planes) for patches that cover some pixel columns and planes; the planes outside,
// so that neighbouring pixel columns follow each other while the voxel columns that they share are in cache.
template <class Visit>
void LevelEngine::each_patch(const Walk& w, LevelView::Run cols, LevelView::Run planes, const Visit& visit) {
  for (int plane = planes.begin; plane < planes.end; plane += w.patch) {
    const int deep = std::min(w.patch, planes.end - plane), wide = kPatch / deep;
    for (int col = cols.begin; col < cols.end; col += wide)
      visit(col, std::min(wide, cols.end - col), plane, deep);
  }
}

void LevelEngine::add_pixel_columns(const Walk& w, std::size_t view, LevelView::Run cols,
                                    LevelView::Run planes, std::span<const float> volume,
                                    std::span<const std::uint8_t> lit, std::span<float> projections) const {
  const LevelView& geometry = views_[view];
  const StripShape shape = w.seen_by(geometry);
  KernelScratch& scratch = scratch_for(shape);
  LevelView::Strips strips;
  const double reach = 2 + geometry.largest_half();
  const auto meets = [&](int col, int plane, int deep) {
    const auto [low, high] =
        std::minmax({geometry.crossing(col, plane), geometry.crossing(col, plane + deep - 1)});
    return low < shape.end + reach && high > shape.begin - reach;
  };
  each_patch(w, cols, planes, [&](int col, int wide, int plane, int deep) {
    if (w.is_parted && !w.along_z) {
      const LevelView::Run run = narrowed({col, col + wide}, [&](int c) { return meets(c, plane, deep); });
      if (run.begin >= run.end) return;
    }
    const StripPatch p = patch(w, view, col, wide, plane, deep, strips);
    if (vectors_) {
      add_forward(volume.data(), lit.data(), p, shape, scratch, projections.data());
    } else {
      add_forward_plain(volume.data(), p, shape, projections.data());
    }
  });
}

void LevelEngine::forward(Team& team, std::span<const std::size_t> views, const Planes& held,
                          std::span<const float> volume, std::span<float> projections) const {
  // A flame leaves much of the box dark.
  std::vector<std::uint8_t> lit(volume.size() / layout_.column);
  team.run_ranges(lit.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const float* column = volume.data() + i * layout_.column;
      lit[i] = std::any_of(column, column + layout_.ny, [](float v) { return v != 0; });
    }
  });
  const auto each_line = [&](const auto& work) {
    team.run_ranges(views.size() * static_cast<std::size_t>(layout_.cols), 64,
                    [&](std::size_t begin, std::size_t end) {
                      for (std::size_t i = begin; i < end; ++i) {
                        work(line(views[i / static_cast<std::size_t>(layout_.cols)],
                                  static_cast<int>(i % static_cast<std::size_t>(layout_.cols))));
                      }
                    });
  };
  each_line([&](std::size_t at) { std::fill_n(projections.data() + at, layout_.line, 0.0f); });
  for (const bool along_z : {true, false}) {
    const Walk w = walk(along_z, held, kForward.patch_floats, kForward.slab);
    const int tiles = w.tiles(), slab = tiles == 1 && !w.is_parted ? w.planes.end : w.slab;
    const int wide = tiles == 1 ? kColumnsPerTask : layout_.cols, parts = (layout_.cols + wide - 1) / wide;
    for (int from = w.planes.begin; from < w.planes.end; from += slab) {
      const LevelView::Run planes{from, std::min(w.planes.end, from + slab)};
      // Each pixel column belongs to one tile of the slab, so that no two tasks share one.
      const auto is_in = [&](const LevelView& view, int col, int tile) {
        const float crossing = view.crossing(col, (planes.begin + planes.end) / 2);
        const double at = (crossing - static_cast<float>(w.shape.begin)) / static_cast<float>(w.tile);
        return tile == static_cast<int>(std::clamp(std::floor(at), 0.0, tiles - 1.0));
      };
      team.run(static_cast<std::size_t>(tiles) * views.size() * static_cast<std::size_t>(parts),
               [&](std::size_t task) {
                 const int part = static_cast<int>(task % static_cast<std::size_t>(parts));
                 const std::size_t v = views[task / static_cast<std::size_t>(parts) % views.size()];
                 const int tile = static_cast<int>(task / static_cast<std::size_t>(parts) / views.size());
                 for (LevelView::Run run : views_[v].runs(along_z)) {
                   run = {std::max(run.begin, part * wide), std::min(run.end, (part + 1) * wide)};
                   if (tiles > 1) run = narrowed(run, [&](int col) { return is_in(views_[v], col, tile); });
                   add_pixel_columns(w, v, run, planes, volume, lit, projections);
                 }
               });
    }
  }
  each_line([&](std::size_t at) {
    const auto rows = static_cast<std::size_t>(layout_.rows);
    for (std::size_t i = at; i < at + rows; ++i) projections[i] *= lengths_[i];
    std::fill_n(projections.data() + at + rows, layout_.line - rows, 0.0f);
  });
}

void LevelEngine::add_tile(const Walk& w, std::size_t view, LevelView::Run planes, LevelView::Run tile,
                           std::span<const float> weighted, std::span<float> volume) const {
  const LevelView& geometry = views_[view];
  StripShape shape = w.seen_by(geometry);
  shape.begin = tile.begin, shape.end = tile.end;
  KernelScratch& scratch = scratch_for(shape);
  LevelView::Strips strips;
  const double reach = 2 + geometry.largest_half();
  const auto meets = [&](int col) {
    const auto [low, high] =
        std::minmax({geometry.crossing(col, planes.begin), geometry.crossing(col, planes.end - 1)});
    return low < tile.end + reach && high > tile.begin - reach;
  };
  for (const LevelView::Run& run : geometry.runs(w.along_z)) {
    each_patch(w, narrowed(run, meets), planes, [&](int col, int wide, int plane, int deep) {
      const StripPatch p = patch(w, view, col, wide, plane, deep, strips);
      if (vectors_) {
        add_adjoint(weighted.data(), p, shape, scratch, volume.data());
      } else {
        add_adjoint_plain(weighted.data(), p, shape, volume.data());
      }
    });
  }
}

void LevelEngine::adjoint(Team& team, std::span<const std::size_t> views, std::span<const float> projections,
                          const Planes& held, std::span<float> volume) const {
  // Lengths are applied once; what is left is the transpose of blend and resample.
  std::vector<float> weighted(projections.size());
  const auto cols = static_cast<std::size_t>(layout_.cols);
  team.run_ranges(views.size() * cols, 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t at = line(views[i / cols], static_cast<int>(i % cols));
      for (std::size_t p = at; p < at + layout_.line; ++p) weighted[p] = projections[p] * lengths_[p];
    }
  });
  for (const bool along_z : {true, false}) {
    const Walk w = walk(along_z, held, kAdjoint.patch_floats, kAdjoint.slab);
    const int tiles = w.tiles(), slabs = (w.planes.end - w.planes.begin + w.slab - 1) / w.slab;
    team.run(static_cast<std::size_t>(slabs) * static_cast<std::size_t>(tiles), [&](std::size_t task) {
      const int from = w.planes.begin + static_cast<int>(task) / tiles * w.slab,
                first = w.shape.begin + static_cast<int>(task) % tiles * w.tile;
      const LevelView::Run planes{from, std::min(w.planes.end, from + w.slab)};
      const LevelView::Run tile{first, std::min(w.shape.end, first + w.tile)};
      const auto each_column = [&](const auto& work) {
        for (int plane = planes.begin; plane < planes.end; ++plane)
          for (int other = tile.begin; other < tile.end; ++other) {
            work(volume.data() + (static_cast<std::size_t>(plane) * w.plane_stride +
                                  static_cast<std::size_t>(other) * w.shape.stride - w.before));
          }
      };
      if (along_z) each_column([&](float* column) { std::fill_n(column, layout_.column, 0.0f); });
      for (const std::size_t v : views) add_tile(w, v, planes, tile, weighted, volume);
      if (along_z) return;
      each_column([&](float* column) { std::fill(column + layout_.ny, column + layout_.column, 0.0f); });
    });
  }
}

void LevelEngine::column(std::size_t voxel, std::vector<ColumnEntry>& entries) const {
  const auto nx = static_cast<std::size_t>(layout_.nx), ny = static_cast<std::size_t>(layout_.ny);
  const int x = static_cast<int>(voxel % nx), y = static_cast<int>(voxel / nx % ny),
            z = static_cast<int>(voxel / nx / ny);
  LevelView::Strips strips;
  for (std::size_t v = 0; v < views_.size(); ++v) {
    const LevelView& view = views_[v];
    const LevelView::Run near = view.near(x, z);
    for (int col = near.begin; col < near.end; ++col) {
      const bool along_z = view.along_z(col);
      const int plane = along_z ? z : x, other = along_z ? x : z;
      view.patch(col, 1, plane, 1, strips);
      const Footprint across = footprint(strips.q[0], strips.half[0], along_z ? layout_.nx : layout_.nz);
      if (other < across.first || other >= across.first + across.count) continue;
      const double m = strips.m[0], half_px = strips.half_px[0];
      const double centre = view.axis_up() + (y - view.height()) / m, reach = 1.5 / m + half_px;
      const int low = std::max(0, static_cast<int>(std::floor(centre - reach)));
      const int high = std::min(layout_.rows - 1, static_cast<int>(std::ceil(centre + reach)));
      for (int up = low; up <= high; ++up) {
        const Footprint along = footprint(view.height() + m * (up - view.axis_up()), m * half_px, layout_.ny);
        if (y < along.first || y >= along.first + along.count) continue;
        const std::size_t pixel =
            (v * static_cast<std::size_t>(layout_.rows) + static_cast<std::size_t>(layout_.rows - 1 - up)) *
                static_cast<std::size_t>(layout_.cols) +
            static_cast<std::size_t>(col);
        entries.push_back({static_cast<std::uint32_t>(pixel),
                           across.weight[other - across.first] * along.weight[y - along.first] *
                               lengths_[line(v, col) + static_cast<std::size_t>(up)]});
      }
    }
  }
}

std::string LevelEngine::name() const {
  return vectors_ ? concat("level, ", vector_target()) : "level, plain";
}

}  // namespace flamefield
