#include "services/spool/spool.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <random>

#include "services/spool/crc32c.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

using testing_support::make_set;
using testing_support::same_pixels;

std::filesystem::path first_segment(const Scratch& scratch) {
  return scratch.path() / "segment-000001.raw";
}

std::vector<char> bytes_of_file(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void write_file(const std::filesystem::path& path, const std::vector<char>& bytes) {
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

TEST(Crc32c, MatchesThePublishedCheckValues) {
  const std::string digits = "123456789";
  EXPECT_EQ(crc32c(std::as_bytes(std::span(digits))), 0xe3069283u);
  EXPECT_EQ(crc32c(std::vector<std::byte>(32)), 0x8a9136aau);  // RFC 3720 B.4: 32 bytes of zeros
}

TEST(Crc32c, MayBeTakenInPieces) {
  const std::string text = "the flame front is where the emission is";
  const auto bytes = std::as_bytes(std::span(text));
  for (std::size_t cut = 0; cut <= bytes.size(); ++cut) {
    EXPECT_EQ(crc32c(bytes.subspan(cut), crc32c(bytes.first(cut))), crc32c(bytes));
    EXPECT_EQ(crc32c(bytes.subspan(cut)), crc32c_by_tables(bytes.subspan(cut)));
  }
}

TEST(Spool, GivesBackWhatWasAppended) {
  Scratch scratch;
  auto spool = Spool::open({scratch.path(), 1 << 20});
  ASSERT_TRUE(spool);
  std::vector<SpoolLocation> locations;
  for (int i = 0; i < 10; ++i) locations.push_back(spool->append(make_set("burst", i)).value());
  ASSERT_TRUE(spool->sync());
  for (int i = 9; i >= 0; --i) {
    const auto set = spool->read(locations[static_cast<std::size_t>(i)]);
    ASSERT_TRUE(set) << set.error().message;
    EXPECT_TRUE(same_pixels(*set, make_set("burst", i)));
  }
}

TEST(Spool, GoesOnInANewSegmentWhenOneIsFull) {
  Scratch scratch;
  const SpoolOptions options{scratch.path(), 4096};
  std::vector<SpoolLocation> locations;
  {
    auto spool = Spool::open(options);
    for (int i = 0; i < 40; ++i) locations.push_back(spool->append(make_set("burst", i, 20)).value());
    locations.push_back(spool->append(make_set("burst", 40, 200)).value());  // larger than a segment
  }
  EXPECT_GT(locations.back().segment, 3u);
  auto spool = Spool::open(options, locations.back());
  for (std::size_t i = 0; i < locations.size(); ++i) {
    const auto set = spool->read(locations[i]);
    ASSERT_TRUE(set) << set.error().message;
    EXPECT_EQ(set->index, static_cast<std::int64_t>(i));
  }
  EXPECT_TRUE(spool->recovered().empty());
}

TEST(Spool, HandsOverTheRecordsBehindTheLastKnownOne) {
  Scratch scratch;
  std::vector<SpoolLocation> locations;
  {
    auto spool = Spool::open({scratch.path(), 2048});
    for (int i = 0; i < 12; ++i) locations.push_back(spool->append(make_set("burst", i)).value());
  }
  auto spool = Spool::open({scratch.path(), 2048}, locations[4]);
  ASSERT_EQ(spool->recovered().size(), 7u);
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_EQ(spool->recovered()[i].location, locations[i + 5]);
    EXPECT_EQ(spool->recovered()[i].set.index, static_cast<std::int64_t>(i + 5));
  }
}

// The power goes while the last record is being written: at whatever byte, all before it stays, the torn one
// is cut off, and the next append works.
TEST(Spool, SurvivesATornLastRecordWhateverTheByte) {
  Scratch scratch;
  SpoolLocation last;
  {
    auto spool = Spool::open({scratch.path(), 4096});
    ASSERT_TRUE(spool->append(make_set("burst", 0)));
    ASSERT_TRUE(spool->append(make_set("burst", 1)));
    last = spool->append(make_set("burst", 2)).value();
  }
  const std::vector<char> whole = bytes_of_file(first_segment(scratch));
  // The last bytes may be padding, which no checksum needs.
  for (std::uint64_t kept = 0; kept + 8 <= last.length; ++kept) {
    std::vector<char> torn = whole;
    std::fill(torn.begin() + static_cast<std::ptrdiff_t>(last.offset + kept), torn.end(), '\0');
    write_file(first_segment(scratch), torn);
    auto spool = Spool::open({scratch.path(), 4096});
    ASSERT_TRUE(spool) << spool.error().message;
    ASSERT_EQ(spool->recovered().size(), 2u) << "torn after " << kept << " bytes";
    const auto again = spool->append(make_set("burst", 3));
    ASSERT_TRUE(again);
    EXPECT_EQ(again->offset, last.offset);
    EXPECT_TRUE(same_pixels(*spool->read(*again), make_set("burst", 3)));
    EXPECT_TRUE(same_pixels(*spool->read(spool->recovered()[1].location), make_set("burst", 1)));
  }
}

TEST(Spool, AFileCutShortAtAnyByteKeepsTheRecordsBefore) {
  Scratch scratch;
  SpoolLocation last;
  {
    auto spool = Spool::open({scratch.path(), 2048});
    ASSERT_TRUE(spool->append(make_set("burst", 0)));
    last = spool->append(make_set("burst", 1)).value();
  }
  const std::vector<char> whole = bytes_of_file(first_segment(scratch));
  for (std::uint64_t kept = 0; kept + 8 <= last.length; kept += 3) {
    write_file(first_segment(scratch),
               {whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(last.offset + kept)});
    auto spool = Spool::open({scratch.path(), 2048});
    ASSERT_TRUE(spool);
    EXPECT_EQ(spool->recovered().size(), 1u);
    const auto next = spool->append(make_set("burst", 2));  // where there is room: in a new segment
    ASSERT_TRUE(next);
    EXPECT_EQ(next->segment, 2u);
    std::filesystem::remove(scratch.path() / "segment-000002.raw");
  }
}

TEST(Spool, AFlippedByteIsFoundByTheChecksum) {
  Scratch scratch;
  auto spool = Spool::open({scratch.path(), 4096});
  const SpoolLocation place = spool->append(make_set("burst", 0)).value();
  ASSERT_TRUE(spool->sync());
  const std::vector<char> whole = bytes_of_file(first_segment(scratch));
  const unsigned seed = std::random_device()();
  SCOPED_TRACE(concat("seed ", seed));
  std::mt19937 random(seed);
  for (int round = 0; round < 200; ++round) {
    std::vector<char> broken = whole;
    const std::size_t at = random() % (place.length - 8);
    broken[at] = static_cast<char>(broken[at] ^ (1 << random() % 8));
    write_file(first_segment(scratch), broken);
    const auto set = spool->read(place);
    ASSERT_FALSE(set) << "byte " << at;
    EXPECT_EQ(set.error().code, ErrorCode::DataLoss);
  }
}

// In a child, since the limit holds for a whole process.
TEST(Spool, AFullDiskIsAnErrorAndHarmsNothing) {
  Scratch scratch;
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{64 * 1024, 64 * 1024};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    auto spool = Spool::open({scratch.path(), 32 * 1024});
    bool ok = spool.has_value();
    std::vector<SpoolLocation> stored;
    for (int i = 0; ok && i < 20; ++i) stored.push_back(spool->append(make_set("burst", i)).value());
    const auto refused = spool->append(make_set("burst", 20, 400));
    ok = ok && !refused && refused.error().code == ErrorCode::Unavailable;
    ok = ok && !std::filesystem::exists(scratch.path() / "segment-000002.raw");
    ok = ok && spool->append(make_set("burst", 21)).has_value() && spool->sync().has_value();
    for (std::size_t i = 0; ok && i < stored.size(); ++i)
      ok = same_pixels(*spool->read(stored[i]), make_set("burst", static_cast<std::int64_t>(i)));
    ::_exit(ok ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  auto spool = Spool::open({scratch.path(), 32 * 1024});
  ASSERT_TRUE(spool);
  EXPECT_EQ(spool->recovered().size(), 21u);
}

TEST(Spool, AnUnwritableDirectoryIsNamed) {
  const auto spool = Spool::open({"/proc/nowhere", 4096});
  ASSERT_FALSE(spool);
  EXPECT_EQ(spool.error().code, ErrorCode::Unavailable);
  EXPECT_NE(spool.error().message.find("/proc/nowhere"), std::string::npos);
}

}  // namespace
}  // namespace flamefield
