#include "reconstruct/evolutionary/checkpoint.h"

namespace flamefield {

std::string checkpoint_identity(const Problem& problem, const ErtOptions& options, float scale) {
  ErtOptions fixed = options;
  fixed.max_generations = 1;
  std::string out = "flamefield-ert-2";
  for (const SettingDoc& doc : describe(ert_fields(fixed)))
    out += concat(' ', doc.key, '=', doc.default_value);
  const Layout& l = problem.projector.layout();
  out += concat(' ', l.nx, ' ', l.ny, ' ', l.nz, ' ', l.views, ' ', l.rows, ' ', l.cols, ' ',
                problem.control.seed, ' ', scale);
  double sum = 0;
  for (const float b : problem.images) sum += static_cast<double>(b);
  return out + concat(' ', sum);
}

tl::unexpected<Error> checkpoint_refused(std::string_view why) {
  return invalid_input("the checkpoint does not fit", std::string(why),
                       "resume with the images, rig, grid, recipe and seed it was made with");
}

}  // namespace flamefield
