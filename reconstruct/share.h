#pragma once

#include <functional>
#include <span>
#include <vector>

#include "proto/error.h"
#include "proto/volume.h"
#include "reconstruct/layout.h"
#include "reconstruct/parallel.h"
#include "reconstruct/ranks.h"

namespace flamefield {

// The planes of constant z that this process holds of a volume, and what it does together with the ranks that
// hold the others. Images are small beside a large volume: every rank has all of them.
//
// The volume is cut into slabs whose borders depend on its size alone, and each rank holds some that follow
// each other. Sums are formed slab by slab and added up in an order that does not know who holds which slab,
// so that results are bit-identical for any number of ranks. Alone, without ranks, the volume is one slab.
class Share {
 public:
  explicit Share(const Grid& whole);  // all of it, alone
  // InvalidInput: more ranks than slabs. `ranks` must outlive this.
  static Result<Share> among(Ranks& ranks, const Grid& whole);

  bool is_alone() const { return ranks_ == nullptr; }
  const Grid& whole() const { return whole_; }
  const Planes& planes() const { return planes_; }
  Grid grid() const;  // of the planes held

  // term(begin, end) for the voxels of each slab held, packed as in `layout`, which is of the planes held;
  // the sum of all slabs' terms, on every rank.
  double sum(const Layout& layout, const std::function<double(std::size_t, std::size_t)>& term) const;
  // Of all ranks' values, which follow each other in the order of planes; on every rank.
  double sum(std::span<const double> values) const;
  double largest(double value) const;

  // images = sum over all slabs of partial(planes, images); `ranges` of the images count, the rest is left
  // alone. Added in pairs of slabs, pairs of pairs and so on.
  struct Range {
    std::size_t begin = 0, size = 0;
  };
  void sum_images(Team& team, std::span<const Range> ranges, std::span<float> images,
                  const std::function<void(const Planes&, std::span<float>)>& partial) const;

  // Neighbouring planes change hands. The last one held goes behind, that of the rank before comes in; or
  // the first one goes to the rank before, and that of the rank behind comes in. At the faces of the box
  // nothing does.
  void pass_behind(std::span<const float> last, std::span<float> before) const;
  void pass_before(std::span<const float> first, std::span<float> behind) const;
  bool has_before() const { return planes_.begin > 0; }
  bool has_behind() const { return planes_.end < whole_.nz; }

  // The planes of all ranks (nz, ny, nx), on rank 0; nothing on others.
  std::vector<float> collect(std::vector<float> held) const;

 private:
  int owner(int slab) const;
  void fold(Team& team, int first, int last, std::span<const Range> ranges, std::span<float> images,
            const std::function<void(const Planes&, std::span<float>)>& partial) const;

  Ranks* ranks_ = nullptr;
  Grid whole_;
  Planes planes_;
  std::vector<Planes> slabs_;             // of the whole volume
  std::vector<int> first_slab_ = {0, 1};  // of each rank, and how many there are
};

// True for all when rank 0 says so; without ranks, as it was.
bool agree(Ranks* ranks, bool value);

}  // namespace flamefield
