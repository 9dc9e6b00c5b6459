// The fuzz targets without libFuzzer: examples, changed at random. Same seeds, same bytes.
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <random>

#include "acquire/simulator/big_endian.h"
#include "acquire/simulator/gvsp.h"
#include "acquire/simulator/registers.h"
#include "services/spool/spool.h"
#include "tests/fuzz/targets.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

using Example = std::vector<std::uint8_t>;

Example mutate(Example bytes, std::mt19937& random) {
  for (auto flips = random() % 6; flips > 0 && !bytes.empty(); --flips)
    bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
  if (random() % 4 == 0) bytes.resize(random() % (bytes.size() + 1));
  if (random() % 6 == 0) bytes.insert(bytes.end(), random() % 64, static_cast<std::uint8_t>(random()));
  return bytes;
}

void bombard(void (*target)(fuzz::Bytes), const std::vector<Example>& examples, int rounds) {
  std::mt19937 random(1);
  for (const Example& example : examples) target(example);
  for (int i = 0; i < rounds; ++i) target(mutate(examples[random() % examples.size()], random));
}

Example bytes_of(const std::string& text) {
  return {text.begin(), text.end()};
}

TEST(FuzzTargets, BusMessagesAreRefusedOrMeanWhatTheySay) {
  PutCapture capture{"burst", CaptureKind::Burst, 1, 2, 30, {"cam00"}, 30, 4, CaptureEnd::Storage, "full"};
  capture.accounts = {{"cam00", 31, 29, {{"missed", 1}}, {{"late", 2}}}};
  CaptureState state;
  state.phase = CapturePhase::Standby;
  state.cameras.push_back({"cam00", "127.0.0.2", true, 3, {{"late", 1}}, 0.5, {{"extra", 1}}});
  bombard(&fuzz::bus_message,
          {bytes_of(encode(PutSet{testing_support::make_set("burst", 3)}, 5)), bytes_of(encode(capture, 6)),
           bytes_of(encode(state, 7)), bytes_of(encode(StartCapture{CaptureKind::Burst, 30, "b", 5}, 8)),
           bytes_of(encode(PutRig{testing_support::make_rig()}, 9))},
          20'000);
}

TEST(FuzzTargets, SegmentsGiveWholeSetsOrNone) {
  const Scratch scratch;
  {
    auto spool = Spool::open({.directory = scratch / "spool", .segment_bytes = 4 << 10});
    ASSERT_TRUE(spool);
    for (int i = 0; i < 3; ++i) ASSERT_TRUE(spool->append(testing_support::make_set("burst", i)));
    ASSERT_TRUE(spool->sync());
  }
  std::ifstream in(std::filesystem::directory_iterator(scratch / "spool")->path(), std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(in), {}};
  bombard(&fuzz::spool_segment, {bytes_of(whole), bytes_of(whole.substr(0, 400))}, 400);
}

TEST(FuzzTargets, ChunksOfACameraNeverLeadOurClientAstray) {
  // Image, frame counter, trigger counter, time, exposure: as the simulated camera sends them.
  Example chunks;
  append_u32(chunks, reg::kChunkImageId);
  append_u32(chunks, 64);
  for (const std::uint32_t id : reg::kChunkIds) {
    Example value;
    append_u32(value, 3);
    if (id == reg::kChunkTimestampId) append_u32(value, 4);
    append_chunk(chunks, id, value);
  }
  bombard(&fuzz::gvsp_chunks, {chunks}, 1500);
}

}  // namespace
}  // namespace flamefield
