#pragma once

#include <array>
#include <string>
#include <vector>

#include "services/study/results.h"

namespace flamefield {

// Fitness against generation, the mean of several runs where all of them have a value.
struct FitnessPath {
  std::vector<double> generation, fitness;
};
FitnessPath mean_path(const std::vector<const FinishedRun*>& runs);

// What the paths of two groups of runs say about the difference between them: which led at first and where
// they crossed, whether they still climbed at the end, whether the field got better along with its images,
// and how large a step there was at the generation that `finding.step_at` names. One sentence each.
std::vector<std::string> explain(const std::vector<const FinishedRun*>& favoured,
                                 const std::vector<const FinishedRun*>& others,
                                 const std::array<std::string, 2>& names, const StudyFinding& finding);

}  // namespace flamefield
