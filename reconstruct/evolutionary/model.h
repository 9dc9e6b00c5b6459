#pragma once

#include <memory>
#include <span>

#include "reconstruct/parallel.h"
#include "reconstruct/projector.h"

namespace flamefield {

// How a field becomes images: all that the evolutionary solver asks of the physics when it renders. Between
// renderings it takes small changes of the field to add their columns of A; a model must be about that, and
// the next rendering puts right what is not.
class MeasurementModel {
 public:
  virtual ~MeasurementModel() = default;
  // volume and images: packed (layout.h), in the scale of the problem; overwrites images
  virtual void render(Team& team, std::span<const float> volume, std::span<float> images) const = 0;
  virtual bool is_linear() const { return false; }
};

// A x.
class LinearModel : public MeasurementModel {
 public:
  explicit LinearModel(const Projector& projector) : projector_(projector) {}
  void render(Team& team, std::span<const float> volume, std::span<float> images) const override {
    projector_.forward(team, volume, images);
  }
  bool is_linear() const override { return true; }

 private:
  const Projector& projector_;
};

// A gas that absorbs what it emits: along a ray from the camera,
//   I = sum_i f_i ds exp(-k sum_{j<i} f_j ds),
// with k the absorption per emission and length. Trilinear, 2 x 2 rays a pixel, two samples a voxel.
class SelfAbsorption : public MeasurementModel {
 public:
  SelfAbsorption(const Projector& projector, double absorption) : projector_(projector), k_(absorption) {}
  void render(Team& team, std::span<const float> volume, std::span<float> images) const override;

 private:
  const Projector& projector_;
  double k_;
};

// absorption 0: linear
std::unique_ptr<MeasurementModel> make_model(const Projector& projector, double absorption);

}  // namespace flamefield
