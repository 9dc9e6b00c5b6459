#include "reconstruct/projector/level_engine.h"

#include <algorithm>

#include "proto/check.h"

namespace flamefield {

namespace {

constexpr std::size_t kSlabFloats = 768 * 1024;  // of voxels that stay in cache while all views pass
constexpr std::size_t kColumnsPerTask = 8;       // pixel columns, forward
constexpr std::size_t kPlanesPerTask = 16;       // adjoint

struct Workbench {
  KernelScratch scratch;
  LevelView::Strips strips;
};
Workbench& workbench() {
  thread_local Workbench bench;
  return bench;
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

LevelEngine::Walk LevelEngine::walk(bool along_z) const {
  const std::size_t row = static_cast<std::size_t>(layout_.nx) * layout_.column;
  Walk out{along_z, along_z ? layout_.nz : layout_.nx, along_z ? row : layout_.column, {}};
  out.shape.ny = layout_.ny;
  out.shape.column = layout_.column;
  out.shape.others = along_z ? layout_.nx : layout_.nz;
  out.shape.stride = along_z ? layout_.column : row;
  out.shape.rows = layout_.rows;
  out.shape.line = layout_.line;
  return out;
}

StripShape LevelEngine::Walk::seen_by(const LevelView& view) const {
  StripShape out = shape;
  out.height = view.height();
  out.axis_up = view.axis_up();
  return out;
}

void LevelEngine::forward(Team& team, std::span<const std::size_t> views, std::span<const float> volume,
                          std::span<float> projections) const {
  const auto cols = static_cast<std::size_t>(layout_.cols);
  // A flame leaves much of the box dark.
  std::vector<std::uint8_t> lit(volume.size() / layout_.column);
  team.run_ranges(lit.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const float* column = volume.data() + i * layout_.column;
      lit[i] = std::any_of(column, column + layout_.ny, [](float v) { return v != 0; });
    }
  });
  const auto add_planes = [&](const Walk& w, std::size_t v, int col, int from, int to) {
    Workbench& bench = workbench();
    bench.scratch.fit(w.shape);
    const LevelView& view = views_[v];
    view.strips_of_column(col, from, to - from, bench.strips);
    StripRow row = bench.strips.row(to - from);
    row.plane = static_cast<std::size_t>(from) * w.plane_stride;
    row.plane_step = w.plane_stride;
    row.line = line(v, col);
    if (vectors_) {
      add_forward(volume.data(), lit.data(), row, w.seen_by(view), bench.scratch, projections.data());
    } else {
      add_forward_plain(volume.data(), row, w.seen_by(view), projections.data());
    }
  };
  for (const bool along_z : {true, false}) {
    const Walk w = walk(along_z);
    const std::size_t plane_floats = static_cast<std::size_t>(w.shape.others) * layout_.column;
    const int slab = volume.size() < 2 * kSlabFloats
                         ? w.planes
                         : std::max(1, static_cast<int>(kSlabFloats / plane_floats));
    for (int from = 0; from < w.planes; from += slab) {
      const int to = std::min(w.planes, from + slab);
      team.run_ranges(views.size() * cols, kColumnsPerTask, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
          const std::size_t view = views[i / cols];
          const int col = static_cast<int>(i % cols);
          float* pixels = projections.data() + line(view, col);
          if (along_z && from == 0) std::fill(pixels, pixels + layout_.line, 0.0f);
          if (views_[view].along_z(col) == along_z) add_planes(w, view, col, from, to);
          if (!along_z && to == w.planes) {
            const float* lengths = lengths_.data() + line(view, col);
            for (std::size_t up = 0; up < layout_.line; ++up) pixels[up] *= lengths[up];
          }
        }
      });
    }
  }
}

void LevelEngine::adjoint(Team& team, std::span<const std::size_t> views, std::span<const float> projections,
                          std::span<float> volume) const {
  // Lengths are applied once; what is left is the transpose of blend and resample.
  std::vector<float> weighted(projections.size());
  team.run_ranges(
      views.size() * static_cast<std::size_t>(layout_.cols), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
          const std::size_t at = line(views[i / static_cast<std::size_t>(layout_.cols)],
                                      static_cast<int>(i % static_cast<std::size_t>(layout_.cols)));
          for (std::size_t p = at; p < at + layout_.line; ++p) weighted[p] = projections[p] * lengths_[p];
        }
      });
  const auto add_views = [&](const Walk& w, int from, int count) {
    Workbench& bench = workbench();
    bench.scratch.fit(w.shape);
    for (const std::size_t v : views) {
      const LevelView& view = views_[v];
      const StripShape shape = w.seen_by(view);
      for (const LevelView::Run& run : view.runs(w.along_z))
        for (int col = run.begin; col < run.end; ++col) {
          view.strips_of_column(col, from, count, bench.strips);
          StripRow row = bench.strips.row(count);
          row.plane = static_cast<std::size_t>(from) * w.plane_stride;
          row.plane_step = w.plane_stride;
          row.line = line(v, col);
          if (vectors_) {
            add_adjoint(weighted.data(), row, shape, bench.scratch, volume.data());
          } else {
            add_adjoint_plain(weighted.data(), row, shape, volume.data());
          }
        }
    }
  };
  for (const bool along_z : {true, false}) {
    const Walk w = walk(along_z);
    team.run_ranges(
        static_cast<std::size_t>(w.planes), kPlanesPerTask, [&](std::size_t begin, std::size_t end) {
          const auto column = [&](std::size_t plane, int other) {
            return volume.data() + plane * w.plane_stride + static_cast<std::size_t>(other) * w.shape.stride;
          };
          if (along_z) std::fill(column(begin, 0), column(end, 0), 0.0f);
          add_views(w, static_cast<int>(begin), static_cast<int>(end - begin));
          if (along_z) return;
          for (std::size_t plane = begin; plane < end; ++plane)
            for (int other = 0; other < w.shape.others; ++other) {
              std::fill(column(plane, other) + layout_.ny, column(plane, other) + layout_.column, 0.0f);
            }
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
      view.strips_of_column(col, plane, 1, strips);
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
