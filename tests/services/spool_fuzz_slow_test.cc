// Segments whose bytes a disk, a crash or a person has changed: what is read is what was written, or it is
// refused.
#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "services/spool/spool.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

using namespace testing_support;

std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(SpoolFuzz, ChangedSegmentsGiveIntactSetsOrNone) {
  const Scratch scratch;
  constexpr std::int64_t kSets = 6;
  std::vector<SpoolLocation> locations;
  {
    auto spool = Spool::open({.directory = scratch / "spool", .segment_bytes = 16 << 10});
    ASSERT_TRUE(spool);
    for (std::int64_t i = 0; i < kSets; ++i) locations.push_back(spool->append(make_set("burst", i)).value());
    ASSERT_TRUE(spool->sync());
  }
  const auto segment = std::filesystem::directory_iterator(scratch / "spool")->path();
  const std::string good = bytes_of(segment);
  int intact = 0, refused = 0;
  for (unsigned seed = 0; seed < 400; ++seed) {
    SCOPED_TRACE(concat("seed ", seed));
    std::mt19937 random(seed);
    std::string bytes = good;
    for (unsigned flips = 1 + random() % 4; flips > 0; --flips)
      bytes[random() % 2000] = static_cast<char>(random());
    if (random() % 4 == 0) bytes.resize(random() % bytes.size());
    overwrite(segment, bytes);
    auto spool = Spool::open({.directory = scratch / "spool", .segment_bytes = 16 << 10});
    ASSERT_TRUE(spool);
    for (const RecoveredSet& found : spool->recovered()) {
      const auto set = spool->read(found.location);
      ASSERT_TRUE(set);
      EXPECT_TRUE(same_pixels(*set, make_set("burst", set->index)));
    }
    for (std::int64_t i = 0; i < kSets; ++i) {
      const auto set = spool->read(locations[static_cast<std::size_t>(i)]);
      ++(set ? intact : refused);
      if (!set) continue;
      EXPECT_TRUE(same_pixels(*set, make_set("burst", i)));
    }
  }
  EXPECT_GT(intact, 100);
  EXPECT_GT(refused, 100);
}

}  // namespace
}  // namespace flamefield
