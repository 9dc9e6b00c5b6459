// The programs are killed with -9, cut off and frozen while a capture goes on. Other seeds, and twenty of
// them: flamefield selftest --chaos --repeat 20
#include <gtest/gtest.h>

#include "tests/services/chaos.h"

namespace flamefield {
namespace {

TEST(Chaos, ThreeHundredSetsSurviveDeadDispatchersAndWorkersCutWiresAndAFrozenWorker) {
  testing_support::expect_survival({});
}

}  // namespace
}  // namespace flamefield
