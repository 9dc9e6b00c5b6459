#include "reconstruct/share.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "proto/check.h"
#include "reconstruct/slabs.h"

namespace flamefield {

namespace {

// Thin slabs cost time, as lines of sight cross more of them, and thick ones leave ranks idle. The projector
// wants an even number of planes before each, and no fewer than four in it.
constexpr int kThinnest = 16, kMostSlabs = 64, kFewestPlanes = 4;

}  // namespace

std::vector<Planes> slabs_of(int nz) {
  int thickness = std::max(kThinnest, (nz + kMostSlabs - 1) / kMostSlabs);
  thickness += thickness % 2;
  std::vector<Planes> out;
  for (int z = 0; z < nz; z += thickness) out.push_back({z, std::min(nz, z + thickness)});
  if (out.size() > 1 && out.back().count() < kFewestPlanes) {
    out.pop_back();
    out.back().end = nz;
  }
  return out;
}

namespace {

void add(Team& team, std::span<const Share::Range> ranges, std::span<const float> terms,
         std::span<float> sums) {
  constexpr std::size_t kGrain = 16384;
  for (const Share::Range& range : ranges) {
    team.run_ranges(range.size, kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = range.begin + begin; i < range.begin + end; ++i) sums[i] += terms[i];
    });
  }
}

}  // namespace

Share::Share(const Grid& whole) : whole_(whole), planes_{0, whole.nz}, slabs_{planes_} {}

Result<Share> Share::among(Ranks& ranks, const Grid& whole) {
  Share out(whole);
  out.ranks_ = &ranks;
  out.slabs_ = slabs_of(whole.nz);
  const auto slabs = static_cast<int>(out.slabs_.size());
  if (ranks.count() > slabs) {
    return invalid_input(
        concat(ranks.count(), " ranks for ", whole.nz, " planes of constant z"),
        concat("they are shared out in slabs of ", out.slabs_.front().count(), ", which makes ", slabs),
        concat("start at most ", slabs, " ranks, with more threads each"));
  }
  out.first_slab_.clear();
  for (int r = 0; r <= ranks.count(); ++r) out.first_slab_.push_back(r * slabs / ranks.count());
  const auto me = static_cast<std::size_t>(ranks.rank());
  out.planes_ = {out.slabs_[static_cast<std::size_t>(out.first_slab_[me])].begin,
                 out.slabs_[static_cast<std::size_t>(out.first_slab_[me + 1] - 1)].end};
  return out;
}

Grid Share::grid() const {
  Grid out = whole_;
  out.nz = planes_.count();
  if (!is_alone()) out.origin_mm.z() += planes_.begin * whole_.spacing_mm.z();
  return out;
}

int Share::owner(int slab) const {
  return static_cast<int>(std::ranges::upper_bound(first_slab_, slab) - first_slab_.begin()) - 1;
}

double Share::sum(std::span<const double> values) const {
  double out = 0;
  const auto add_up = [&](std::span<const double> terms) {
    for (const double term : terms) out += term;
  };
  if (is_alone()) {
    add_up(values);
    return out;
  }
  for (const std::vector<std::byte>& bytes : ranks_->gather(std::as_bytes(values))) {
    std::vector<double> terms(bytes.size() / sizeof(double));
    std::memcpy(terms.data(), bytes.data(), bytes.size());
    add_up(terms);
  }
  return out;
}

double Share::sum(const Layout& layout, const std::function<double(std::size_t, std::size_t)>& term) const {
  std::vector<double> terms;
  for (const Planes& slab : slabs_) {
    if (slab.begin < planes_.begin || slab.end > planes_.end) continue;
    terms.push_back(
        term(layout.voxel(0, 0, slab.begin - planes_.begin), layout.voxel(0, 0, slab.end - planes_.begin)));
  }
  return sum(terms);
}

double Share::largest(double value) const {
  if (is_alone()) return value;
  for (const std::vector<std::byte>& bytes : ranks_->gather(std::as_bytes(std::span(&value, 1)))) {
    double other = 0;
    std::memcpy(&other, bytes.data(), sizeof other);
    value = std::max(value, other);
  }
  return value;
}

void Share::sum_images(Team& team, std::span<const Range> ranges, std::span<float> images,
                       const std::function<void(const Planes&, std::span<float>)>& partial) const {
  if (is_alone()) return partial(planes_, images);
  fold(team, 0, static_cast<int>(slabs_.size()), ranges, images, partial);
  for (const Range& range : ranges)
    ranks_->broadcast(0, std::as_writable_bytes(images.subspan(range.begin, range.size)));
}

// The sum over slabs first .. last - 1 ends with whoever holds the first of them. No rank waits before it has
// done all of its own slabs: those of other ranks come after them.
void Share::fold(Team& team, int first, int last, std::span<const Range> ranges, std::span<float> images,
                 const std::function<void(const Planes&, std::span<float>)>& partial) const {
  const int me = ranks_->rank();
  if (last - first == 1) return partial(slabs_[static_cast<std::size_t>(first)], images);
  const int middle = first + static_cast<int>(std::bit_ceil(static_cast<unsigned>(last - first)) / 2);
  const int left = owner(first), right = owner(middle);
  const bool in_left = me >= left && me <= owner(middle - 1);
  const bool in_right = me >= right && me <= owner(last - 1);
  if (in_left) fold(team, first, middle, ranges, images, partial);
  if (!in_right && me != left) return;
  std::vector<float> own;
  if (in_left) own.resize(images.size());
  const std::span<float> other = in_left ? std::span<float>(own) : images;
  if (in_right) fold(team, middle, last, ranges, other, partial);
  for (const Range& range : ranges) {
    const std::span<float> part = other.subspan(range.begin, range.size);
    if (left != right && me == left) ranks_->receive(right, std::as_writable_bytes(part));
    if (left != right && me == right) ranks_->send(left, std::as_bytes(part));
  }
  if (me == left) add(team, ranges, other, images);
}

void Share::pass_behind(std::span<const float> last, std::span<float> before) const {
  if (is_alone()) return;
  ranks_->exchange(has_behind() ? ranks_->rank() + 1 : Ranks::kNobody, std::as_bytes(last),
                   has_before() ? ranks_->rank() - 1 : Ranks::kNobody, std::as_writable_bytes(before));
}

void Share::pass_before(std::span<const float> first, std::span<float> behind) const {
  if (is_alone()) return;
  ranks_->exchange(has_before() ? ranks_->rank() - 1 : Ranks::kNobody, std::as_bytes(first),
                   has_behind() ? ranks_->rank() + 1 : Ranks::kNobody, std::as_writable_bytes(behind));
}

std::vector<float> Share::collect(std::vector<float> held) const {
  if (is_alone() || ranks_->count() == 1) return held;
  if (ranks_->rank() > 0) {
    ranks_->send(0, std::as_bytes(std::span(held)));
    return {};
  }
  const std::size_t plane = held.size() / static_cast<std::size_t>(planes_.count());
  std::vector<float> out = std::move(held);
  out.resize(plane * static_cast<std::size_t>(whole_.nz));
  for (int r = 1; r < ranks_->count(); ++r) {
    const auto slab = [&](int i) {
      return static_cast<std::size_t>(first_slab_[static_cast<std::size_t>(i)]);
    };
    const auto begin = static_cast<std::size_t>(slabs_[slab(r)].begin),
               end = static_cast<std::size_t>(slabs_[slab(r + 1) - 1].end);
    ranks_->receive(r, std::as_writable_bytes(std::span(out).subspan(begin * plane, (end - begin) * plane)));
  }
  return out;
}

bool agree(Ranks* ranks, bool value) {
  if (!ranks) return value;
  auto answer = static_cast<std::byte>(value);
  ranks->broadcast(0, std::span(&answer, 1));
  return answer != std::byte{0};
}

}  // namespace flamefield
