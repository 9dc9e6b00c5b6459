#include "reconstruct/evolutionary/strip_table.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace flamefield {

namespace {

using PixelWeight = std::pair<std::uint32_t, float>;  // packed pixel

// From entries in ascending order.
void append_strips(std::span<const PixelWeight> entries, std::vector<Strip>& strips) {
  for (std::size_t i = 0; i < entries.size();) {
    Strip strip{entries[i].first, {}};
    for (; i < entries.size() && entries[i].first < strip.first + Strip::kPixels; ++i)
      strip.weight[entries[i].first - strip.first] += entries[i].second;
    strips.push_back(strip);
  }
}

// Sums columns in a dense image and remembers where it was touched.
class ColumnSum {
 public:
  explicit ColumnSum(std::size_t image_floats) : sum_(image_floats, 0) {}

  void add(std::span<const Strip> strips, float share) {
    for (const Strip& strip : strips)
      for (std::size_t k = 0; k < Strip::kPixels; ++k) {
        if (strip.weight[k] == 0) continue;
        const auto pixel = static_cast<std::uint32_t>(strip.first + k);
        if (sum_[pixel] == 0) touched_.push_back(pixel);
        sum_[pixel] += share * strip.weight[k];
      }
  }
  void take(std::vector<Strip>& strips) {
    std::ranges::sort(touched_);
    entries_.clear();
    for (const std::uint32_t pixel : touched_) {
      if (sum_[pixel] != 0) entries_.emplace_back(pixel, sum_[pixel]);
      sum_[pixel] = 0;
    }
    touched_.clear();
    append_strips(entries_, strips);
  }

 private:
  std::vector<float> sum_;
  std::vector<std::uint32_t> touched_;
  std::vector<PixelWeight> entries_;
};

constexpr std::size_t kParts = 16;

std::pair<std::size_t, std::size_t> part(std::size_t voxels, std::size_t index) {
  return {voxels * index / kParts, voxels * (index + 1) / kParts};
}

}  // namespace

StripTable::StripTable(const Projector& projector, float scale, double budget_mib, Team& team)
    : projector_(&projector),
      scale_(scale),
      voxels_(projector.grid().voxels()),
      image_floats_(projector.layout().pixels() + Strip::kPixels) {
  // The middle of the box is seen by most pixels: were all voxels like those, would they fit?
  const Grid& g = projector.grid();
  std::vector<Strip> middle;
  work_out(g.index(g.nx / 2, g.ny / 2, g.nz / 2), middle);
  const double needed_mib = static_cast<double>(voxels_) *
                            static_cast<double>(middle.size() * sizeof(Strip) + sizeof(std::size_t)) /
                            1048576;
  if (needed_mib > budget_mib) return;
  std::vector<std::vector<Strip>> parts(kParts);
  std::vector<std::size_t> sizes(voxels_ + 1, 0);
  team.run(kParts, [&](std::size_t p) {
    std::vector<Strip> strips;
    const auto [begin, end] = part(voxels_, p);
    for (std::size_t voxel = begin; voxel < end; ++voxel) {
      work_out(voxel, strips);
      parts[p].insert(parts[p].end(), strips.begin(), strips.end());
      sizes[voxel + 1] = strips.size();
    }
  });
  store(parts, sizes);
}

StripTable::StripTable(const StripTable& fine, const Interpolation& interpolation,
                       std::span<const float> density, Team& team)
    : voxels_(interpolation.coarse().voxels()), image_floats_(fine.image_floats_) {
  std::vector<std::vector<Strip>> parts(kParts);
  std::vector<std::size_t> sizes(voxels_ + 1, 0);
  team.run(kParts, [&](std::size_t p) {
    ColumnSum sum(image_floats_);
    std::vector<Strip> scratch;
    const auto [begin, end] = part(voxels_, p);
    for (std::size_t voxel = begin; voxel < end; ++voxel) {
      if (!(density[voxel] > 0)) continue;
      interpolation.visit(voxel, [&](std::size_t j, float share) { sum.add(fine.of(j, scratch), share); });
      const std::size_t before = parts[p].size();
      sum.take(parts[p]);
      sizes[voxel + 1] = parts[p].size() - before;
    }
  });
  store(parts, sizes);
}

void StripTable::store(std::vector<std::vector<Strip>>& parts, std::vector<std::size_t>& sizes) {
  std::partial_sum(sizes.begin(), sizes.end(), sizes.begin());
  start_ = std::move(sizes);
  strips_.reserve(start_.back());
  for (std::vector<Strip>& strips : parts) {
    strips_.insert(strips_.end(), strips.begin(), strips.end());
    strips = {};
  }
}

void StripTable::work_out(std::size_t voxel, std::vector<Strip>& strips) const {
  thread_local std::vector<ColumnEntry> column;
  thread_local std::vector<PixelWeight> entries;
  projector_->column(voxel, column);
  const Layout& layout = projector_->layout();
  const auto rows = static_cast<std::uint32_t>(layout.rows), cols = static_cast<std::uint32_t>(layout.cols);
  entries.clear();
  for (const ColumnEntry& e : column) {
    const std::size_t packed =
        layout.pixel(static_cast<int>(e.pixel / (rows * cols)), static_cast<int>(e.pixel / cols % rows),
                     static_cast<int>(e.pixel % cols));
    entries.emplace_back(static_cast<std::uint32_t>(packed), scale_ * e.weight);
  }
  std::ranges::sort(entries);
  strips.clear();
  append_strips(entries, strips);
}

std::span<const Strip> StripTable::of(std::size_t voxel, std::vector<Strip>& scratch) const {
  if (is_stored()) return std::span(strips_).subspan(start_[voxel], start_[voxel + 1] - start_[voxel]);
  work_out(voxel, scratch);
  return scratch;
}

}  // namespace flamefield
