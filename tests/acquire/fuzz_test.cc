// Bytes from outside, cut and flipped at random: decoders must refuse or decode them, never read beyond.
// Run under the asan preset to see what these tests are for. Same seeds, same bytes.
#include <arpa/inet.h>
#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "acquire/discovery.h"
#include "acquire/simulator/faults.h"
#include "acquire/simulator/gvcp.h"
#include "acquire/simulator/simulated_camera.h"
#include "acquire/simulator/test_image.h"

namespace flamefield {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes mutate(Bytes bytes, std::mt19937& random) {
  for (unsigned flips = random() % 8; flips > 0 && !bytes.empty(); --flips)
    bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
  if (random() % 3 == 0) bytes.resize(random() % (bytes.size() + 1));
  if (random() % 5 == 0) bytes.insert(bytes.end(), random() % 64, static_cast<std::uint8_t>(random()));
  return bytes;
}

const std::vector<Bytes>& commands() {
  static const std::vector<Bytes> all = {
      {0x42, 1, 0, 2, 0, 0, 0, 1},                                          // discovery
      {0x42, 1, 0, 0x80, 0, 8, 0, 2, 0, 0, 0x0a, 0, 0, 0, 0x20, 8},         // read two registers
      {0x42, 1, 0, 0x82, 0, 8, 0, 3, 0, 0, 0x0a, 0, 0, 0, 0, 2},            // write one
      {0x42, 1, 0, 0x84, 0, 8, 0, 4, 0, 1, 0, 0, 0, 0, 2, 0},               // read memory
      {0x42, 1, 0, 0x86, 0, 8, 0, 5, 0, 0, 0, 0xe8, 'c', 'a', 'm', 0},      // write memory
      {0x42, 0, 0, 0x40, 0, 12, 0, 6, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 9},  // resend
      {0x42, 1, 1, 0, 0, 12, 0, 7, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}};    // action
  return all;
}

TEST(Fuzz, NoControlPacketMakesACameraReadOrWriteBeyondItsMemory) {
  std::mt19937 random(1);
  SimulatedCameraOptions options;
  options.width_px = options.height_px = 16;
  options.serial = "1";
  options.user_name = "cam00";
  const int socket = ::socket(AF_INET, SOCK_DGRAM, 0);
  SimulatedCamera camera(
      options, [] { return Scene(); }, socket);
  sockaddr_in from{};
  from.sin_family = AF_INET;
  from.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  from.sin_port = htons(9);
  for (int i = 0; i < 20'000; ++i) {
    const Bytes packet = mutate(commands()[random() % commands().size()], random);
    const auto reply = camera.handle(packet, from);
    if (!reply) continue;
    EXPECT_LE(reply->size(), 8 + 4 + kMaxMemoryBlock);
  }
  EXPECT_GT(camera.counters().commands, 1000);
  EXPECT_GT(camera.counters().refused_packets, 1000);
}

TEST(Fuzz, DiscoveryAnswersAreDecodedOrRefused) {
  std::mt19937 random(2);
  Bytes answer(8 + 0xf8, 'x');  // texts without an end
  answer[3] = 0x03;
  int decoded = 0;
  for (int i = 0; i < 20'000; ++i) {
    const Bytes bytes = mutate(answer, random);
    const auto camera = decode_discovery(bytes.data(), bytes.size());
    if (!camera) continue;
    ++decoded;
    EXPECT_LE(camera->serial.size(), 16u);
    EXPECT_LE(camera->vendor.size(), 32u);
  }
  EXPECT_GT(decoded, 1000);
}

TEST(Fuzz, FaultsAreParsedOrRefused) {
  std::mt19937 random(3);
  const std::string kinds[] = {"missed@12", "dead@20-29", "loss@0.005", "delay@7", "cut@1-3"};
  int parsed = 0;
  for (int i = 0; i < 20'000; ++i) {
    const std::string& kind = kinds[random() % 5];
    const Bytes bytes = mutate(Bytes(kind.begin(), kind.end()), random);
    CameraFaults faults;
    if (add_fault(std::string(bytes.begin(), bytes.end()), faults)) {
      ++parsed;
      EXPECT_GE(faults.packet_loss, 0);
      EXPECT_LE(faults.packet_loss, 1);
    }
  }
  EXPECT_GT(parsed, 500);
}

TEST(Fuzz, NoPictureButATestImageIsTakenForOne) {
  std::mt19937 random(4);
  TestImage image;
  for (int i = 0; i < 2'000; ++i) {
    const ImageStamp stamp{random() % 64, static_cast<std::int64_t>(random()), random() % 2 == 0};
    const auto wire = image.expose({.width_px = 32, .height_px = 8}, stamp);
    Bytes changed = wire;
    changed[random() % changed.size()] ^= static_cast<std::uint8_t>(1 + random() % 255);
    for (const Bytes& bytes : {wire, changed}) {
      auto copy = std::make_shared<std::vector<std::byte>>(bytes.size());
      std::memcpy(copy->data(), bytes.data(), bytes.size());
      Frame frame;
      frame.width_px = 32;
      frame.height_px = 8;
      frame.bytes = copy;
      EXPECT_EQ(read_test_image(frame).has_value(), bytes == wire);
    }
  }
}

}  // namespace
}  // namespace flamefield
