#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <random>

#include "services/store/file.h"
#include "services/store/npy.h"
#include "services/store/volume_file.h"
#include "tests/support/scratch.h"

namespace flamefield {
namespace {

Volume uneven_volume() {
  Volume volume(Grid{5, 4, 3, {0.5, 0.7, 0.9}, {-1, 2, 3.25}});
  for (std::size_t i = 0; i < volume.values.size(); ++i) volume.values[i] = static_cast<float>(i) * 0.37f - 1;
  return volume;
}

TEST(VolumeFile, KeepsValuesGridAndProvenanceInVtkhdf) {
  const Scratch scratch;
  const Volume volume = uneven_volume();
  const std::vector<float> sigma(volume.values.size(), 0.25f);
  const Provenance provenance = {{"solver", "mlem"}, {"laboratory", "Cambridge ± β"}, {"empty", ""}};
  ASSERT_TRUE(write_volume(scratch / "v.vtkhdf", volume, provenance, sigma));
  const auto record = read_volume_record(scratch / "v.vtkhdf");
  ASSERT_TRUE(record) << record.error().message;
  EXPECT_EQ(record->volume.grid, volume.grid);
  EXPECT_EQ(record->volume.values, volume.values);
  EXPECT_EQ(record->sigma, sigma);
  EXPECT_EQ(record->provenance, provenance);
}

TEST(VolumeFile, KeepsValuesAndGridInVtiAndTiff) {
  const Scratch scratch;
  for (const char* name : {"v.vti", "v.tif"}) {
    ASSERT_TRUE(write_volume(scratch / name, uneven_volume(), {})) << name;
    const auto volume = read_volume(scratch / name);
    ASSERT_TRUE(volume) << volume.error().message;
    EXPECT_EQ(volume->grid, uneven_volume().grid) << name;
    EXPECT_EQ(volume->values, uneven_volume().values) << name;
  }
}

TEST(VolumeFile, CentresAnNpyOnTheWorldOriginWithTheGivenSpacing) {
  const Scratch scratch;
  ASSERT_TRUE(write_volume(scratch / "v.npy", uneven_volume(), {}));
  const auto volume = read_volume(scratch / "v.npy", 0.5);
  ASSERT_TRUE(volume) << volume.error().message;
  EXPECT_EQ(volume->grid, centred_grid(5, 4, 3, 0.5));
  EXPECT_EQ(volume->values, uneven_volume().values);
}

TEST(VolumeFile, RefusesASpacingThatContradictsTheFile) {
  const Scratch scratch;
  ASSERT_TRUE(write_volume(scratch / "v.vtkhdf", uneven_volume(), {}));
  const auto volume = read_volume(scratch / "v.vtkhdf", 0.5);
  ASSERT_FALSE(volume);
  EXPECT_NE(volume.error().message.find("v.vtkhdf"), std::string::npos);
}

TEST(VolumeFile, WritesTheSameBytesForTheSameVolume) {
  const Scratch scratch;
  for (const char* extension : {".vtkhdf", ".vti", ".npy", ".tif"}) {
    const auto a = scratch / (std::string("a") + extension), b = scratch / (std::string("b") + extension);
    ASSERT_TRUE(write_volume(a, uneven_volume(), {{"solver", "mlem"}}));
    ASSERT_TRUE(write_volume(b, uneven_volume(), {{"solver", "mlem"}}));
    EXPECT_EQ(*read_text_file(a), *read_text_file(b)) << extension;
  }
}

TEST(VolumeFile, CutShortAnywhereIsAnErrorThatNamesTheFile) {
  const Scratch scratch;
  for (const char* extension : {".vtkhdf", ".vti", ".npy", ".tif"}) {
    const auto whole = scratch / (std::string("whole") + extension),
               cut = scratch / (std::string("cut") + extension);
    ASSERT_TRUE(write_volume(whole, uneven_volume(), {{"solver", "mlem"}}));
    const std::string bytes = *read_text_file(whole);
    // A .vti's closing tags carry nothing, nor does what follows the last page of a .tif.
    const std::size_t needed = extension == std::string(".vti") ? bytes.size() - 40 : bytes.size();
    for (std::size_t length = 0; length < needed; length += 1 + needed / 150) {
      overwrite(cut, bytes.substr(0, length));
      const auto volume = read_volume(cut);
      if (volume) {
        EXPECT_TRUE(extension == std::string(".tif")) << extension << " of " << length;
        continue;
      }
      EXPECT_NE(volume.error().message.find(std::string("cut") + extension), std::string::npos);
    }
  }
}

TEST(VolumeFile, DamagedVtkhdfIsRefusedOrReadsAsWritten) {
  const Scratch scratch;
  ASSERT_TRUE(write_volume(scratch / "whole.vtkhdf", uneven_volume(), {{"solver", "mlem"}}));
  const std::string bytes = *read_text_file(scratch / "whole.vtkhdf");
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  for (int trial = 0; trial < 400; ++trial) {
    std::string damaged = bytes;
    damaged[random() % damaged.size()] ^= static_cast<char>(1u << random() % 8);
    overwrite(scratch / "damaged.vtkhdf", damaged);
    const auto volume = read_volume(scratch / "damaged.vtkhdf");
    if (!volume) continue;
    EXPECT_EQ(volume->grid, uneven_volume().grid);
    EXPECT_EQ(volume->values, uneven_volume().values);
  }
}

TEST(VolumeFile, DamagedExportsNeverCrashTheReader) {
  const Scratch scratch;
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  for (const char* extension : {".vti", ".npy", ".tif"}) {
    const auto path = scratch / (std::string("v") + extension);
    ASSERT_TRUE(write_volume(path, uneven_volume(), {}));
    const std::string bytes = *read_text_file(path);
    for (int trial = 0; trial < 300; ++trial) {
      std::string damaged = bytes;
      for (int flip = 0; flip < 3; ++flip)
        damaged[random() % damaged.size()] ^= static_cast<char>(1u << random() % 8);
      overwrite(path, damaged);
      const auto volume = read_volume(path);
      EXPECT_TRUE(!volume || volume->values.size() == volume->grid.voxels());
    }
  }
}

TEST(VolumeFile, AnUnknownExtensionIsRefusedBothWays) {
  const Scratch scratch;
  EXPECT_FALSE(write_volume(scratch / "v.stl", uneven_volume(), {}));
  EXPECT_FALSE(read_volume(scratch / "v.stl"));
  EXPECT_TRUE(scratch.is_empty());
}

TEST(VolumeFile, LeavesNothingBehindWhereItCannotWrite) {
  const Scratch scratch;
  for (const char* extension : {".vtkhdf", ".vti", ".npy", ".tif"}) {
    const auto path = scratch / (std::string("missing/v") + extension);
    const auto written = write_volume(path, uneven_volume(), {});
    ASSERT_FALSE(written);
    EXPECT_NE(written.error().message.find("missing/v"), std::string::npos) << written.error().message;
  }
  EXPECT_TRUE(scratch.is_empty());
}

// A limit on the size of files stands in for a full disk.
TEST(VolumeFile, AFullDiskLeavesNothingBehind) {
  const Scratch scratch;
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit tight{20'000, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &tight), 0);
  std::vector<Result<>> results;
  for (const char* extension : {".vtkhdf", ".vti", ".npy", ".tif"}) {
    results.push_back(
        write_volume(scratch / (std::string("v") + extension), Volume(centred_grid(40, 40, 40, 1), 1), {}));
  }
  ::setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  for (const Result<>& result : results) EXPECT_FALSE(result);
  EXPECT_TRUE(scratch.is_empty());
  EXPECT_TRUE(write_volume(scratch / "v.vtkhdf", uneven_volume(), {}));
}

TEST(Npy, ReadsDoublesAndTheOtherByteOrder) {
  const Scratch scratch;
  const auto npy = [](const std::string& descr, const std::string& data) {
    std::string header = "{'descr': '" + descr + "', 'fortran_order': False, 'shape': (2,), }\n";
    return std::string("\x93NUMPY\x01\x00", 8) + static_cast<char>(header.size()) + '\0' + header + data;
  };
  overwrite(scratch / "a.npy", npy(">f4", std::string("\x3f\xc0\0\0\xc0\0\0\0", 8)));
  EXPECT_EQ(read_npy(scratch / "a.npy")->values, (std::vector<float>{1.5f, -2}));
  overwrite(scratch / "b.npy", npy("<f8", std::string("\0\0\0\0\0\0\xf8\x3f\0\0\0\0\0\0\0\xc0", 16)));
  EXPECT_EQ(read_npy(scratch / "b.npy")->values, (std::vector<float>{1.5f, -2}));
}

TEST(Npy, RefusesWhatIsNoFloatArrayAndSaysHowToConvertIt) {
  const Scratch scratch;
  const auto message_of = [&](const std::string& header) {
    overwrite(scratch / "a.npy", std::string("\x93NUMPY\x01\x00", 8) + static_cast<char>(header.size()) +
                                     '\0' + header + std::string(8, '\0'));
    const auto array = read_npy(scratch / "a.npy");
    return array ? "read" : array.error().message;
  };
  using testing::Message;
  EXPECT_NE(message_of("{'descr': '<i4', 'fortran_order': False, 'shape': (2,), }\n").find("float32"),
            std::string::npos);
  EXPECT_NE(message_of("{'descr': '<f4', 'fortran_order': True, 'shape': (2,), }\n").find("Fortran"),
            std::string::npos);
  EXPECT_NE(message_of("{'descr': '<f4', 'fortran_order': False, 'shape': (3,), }\n").find("cut short"),
            std::string::npos);
  EXPECT_NE(message_of("{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999, 99999999999), }\n")
                .find("cut short"),
            std::string::npos);
  EXPECT_NE(message_of("{'descr': '<f4', 'fortran_order': False}\n").find("damaged"), std::string::npos);
}

TEST(AtomicFile, ReplacesTheOldFileOnlyWhenCommitted) {
  const Scratch scratch;
  overwrite(scratch / "a.txt", "old");
  {
    auto file = AtomicFile::create(scratch / "a.txt");
    ASSERT_TRUE(file);
    ASSERT_TRUE(file->write("new"));
  }
  EXPECT_EQ(*read_text_file(scratch / "a.txt"), "old");
  ASSERT_TRUE(write_text_file(scratch / "a.txt", "new"));
  EXPECT_EQ(*read_text_file(scratch / "a.txt"), "new");
  EXPECT_EQ(scratch.entries(), 1u);
}

TEST(AtomicFile, RefusesFoldersAndDevices) {
  const Scratch scratch;
  EXPECT_FALSE(check_writable(scratch.path()));
  EXPECT_FALSE(check_writable("/dev/null"));
  EXPECT_FALSE(open_input(scratch.path()));
}

}  // namespace
}  // namespace flamefield
