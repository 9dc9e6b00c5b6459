#pragma once

#include <map>
#include <memory>
#include <mutex>

#include "proto/image.h"
#include "proto/rig.h"
#include "proto/volume.h"
#include "services/study/settings.h"

namespace flamefield {

// What the runs of one known field and one ring share. The images are rendered from voxels `finer` times
// smaller than those of the truth, so that no result rests on an inverse crime.
struct StudyScene {
  Volume truth;  // averaged over the voxels of the reconstruction
  Rig rig;
  Projections images;
};
Result<StudyScene> make_scene(const RunSettings& run, FieldFiles& fields, int threads);

// StudyScenes in use, each made once. Thread-safe; a scene goes when nobody holds it.
class StudyScenes {
 public:
  explicit StudyScenes(FieldFiles& fields) : fields_(fields) {}
  Result<std::shared_ptr<const StudyScene>> get(const RunSettings& run, int threads);

 private:
  struct Entry {
    std::mutex mutex;
    std::weak_ptr<const StudyScene> scene;
  };
  FieldFiles& fields_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Entry>> entries_;
};

}  // namespace flamefield
