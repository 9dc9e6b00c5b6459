#include "acquire/simulator/gvcp.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <random>
#include <vector>

#include "acquire/simulator/simulated_array.h"
#include "proto/error.h"

namespace flamefield {
namespace {

using Bytes = std::vector<std::uint8_t>;

// A READREG of the register at 0x0a00.
Bytes read_register_packet() {
  return {0x42, 0x01, 0x00, 0x80, 0x00, 0x04, 0x12, 0x34, 0x00, 0x00, 0x0a, 0x00};
}

TEST(Gvcp, DecodesWhatTheStandardWrites) {
  const Bytes packet = read_register_packet();
  const auto command = decode_gvcp(packet);
  ASSERT_TRUE(command);
  EXPECT_EQ(command->code, GvcpCode::ReadRegisters);
  EXPECT_TRUE(command->wants_acknowledge);
  EXPECT_EQ(command->request_id, 0x1234);
  EXPECT_EQ(decode_read_registers(command->payload), std::vector<std::uint32_t>{0x0a00});
}

TEST(Gvcp, EveryTruncationIsRefused) {
  const Bytes packet = read_register_packet();
  for (std::size_t size = 0; size < packet.size(); ++size) {
    EXPECT_FALSE(decode_gvcp(std::span(packet).first(size))) << size << " bytes";
  }
}

TEST(Gvcp, LengthsThatDoNotFitTheCommandAreRefused) {
  const Bytes zeros(600, 0);
  for (std::size_t size = 0; size <= zeros.size(); ++size) {
    const auto payload = std::span(zeros).first(size);
    EXPECT_EQ(decode_read_registers(payload).has_value(),
              size > 0 && size % 4 == 0 && size <= kMaxMemoryBlock);
    EXPECT_EQ(decode_write_registers(payload).has_value(),
              size > 0 && size % 8 == 0 && size <= kMaxMemoryBlock);
    EXPECT_FALSE(decode_read_memory(payload)) << "a block of no bytes";
    EXPECT_EQ(decode_resend(payload).has_value(), size >= 12);
  }
}

TEST(Gvcp, ResendOfABackwardRangeIsRefused) {
  const Bytes payload = {0, 0, 0, 1, 0, 0, 0, 9, 0, 0, 0, 8};
  EXPECT_FALSE(decode_resend(payload));
}

// The camera's answers, without sockets in between.
class GvcpCameraTest : public ::testing::Test {
 protected:
  GvcpCameraTest()
      : camera_(
            {.number = 0,
             .serial = "1",
             .user_name = "cam00",
             .address = {htonl(INADDR_LOOPBACK)},
             .width_px = 32,
             .height_px = 24,
             .sensor = SensorModel::ideal()},
            [] { return Scene(); }, ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    client_.sin_family = AF_INET;
    client_.sin_port = htons(40000);
    client_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  }
  // Status and, for one register, its value.
  GvcpStatus write(std::uint32_t address, std::uint32_t value, const sockaddr_in& from) {
    const auto byte = [](std::uint32_t word, int shift) { return static_cast<std::uint8_t>(word >> shift); };
    const Bytes packet = {0x42,
                          1,
                          0,
                          0x82,
                          0,
                          8,
                          0,
                          1,
                          byte(address, 24),
                          byte(address, 16),
                          byte(address, 8),
                          byte(address, 0),
                          byte(value, 24),
                          byte(value, 16),
                          byte(value, 8),
                          byte(value, 0)};
    const auto reply = camera_.handle(packet, from);
    EXPECT_TRUE(reply);
    return static_cast<GvcpStatus>((*reply)[0] << 8 | (*reply)[1]);
  }

  SimulatedCamera camera_;
  sockaddr_in client_{};
};

TEST_F(GvcpCameraTest, RandomPacketsNeverBreakIt) {
  const unsigned seed = 20260722;
  std::mt19937 random(seed);
  const std::uint8_t codes[] = {0x02, 0x40, 0x80, 0x82, 0x84, 0x86, 0x89, 0x00};
  for (int i = 0; i < 20000; ++i) {
    SCOPED_TRACE(concat("seed ", seed, " packet ", i));
    Bytes packet(random() % 64);
    for (std::uint8_t& byte : packet) byte = static_cast<std::uint8_t>(random());
    if (packet.size() >= 8 && random() % 4 != 0) {
      packet[0] = 0x42;
      packet[2] = 0;
      packet[3] = codes[random() % std::size(codes)];
      packet[4] = 0;
      packet[5] = static_cast<std::uint8_t>(random() % 2 == 0 ? packet.size() - 8 : random());
      if (packet.size() >= 12 && random() % 2 == 0) packet[8] = packet[9] = 0;  // an address in reach
    }
    const auto reply = camera_.handle(packet, client_);
    EXPECT_LE(reply ? reply->size() : 0, 8 + 4 + kMaxMemoryBlock);
  }
  const auto counters = camera_.counters();
  EXPECT_EQ(counters.commands + counters.refused_packets, 20000);
  EXPECT_GT(counters.commands, 1000);
}

TEST_F(GvcpCameraTest, OneClientHasControlAndTheOthersMayOnlyRead) {
  sockaddr_in other = client_;
  other.sin_port = htons(40001);
  EXPECT_EQ(write(0x0a00, 2, client_), GvcpStatus::Success);
  EXPECT_EQ(write(0x0a00, 2, other), GvcpStatus::AccessDenied);
  EXPECT_EQ(write(0x2048, 100, other), GvcpStatus::AccessDenied);
  EXPECT_TRUE(camera_.handle(read_register_packet(), other));
  EXPECT_EQ(write(0x0a00, 0, client_), GvcpStatus::Success);
  EXPECT_EQ(write(0x0a00, 2, other), GvcpStatus::Success);
}

TEST_F(GvcpCameraTest, WritesOutOfRangeOrToConstantsAreRefused) {
  EXPECT_EQ(write(0x2008, 33, client_), GvcpStatus::InvalidParameter);  // Width of a 32 px sensor
  EXPECT_EQ(write(0x2008, 0, client_), GvcpStatus::InvalidParameter);
  EXPECT_EQ(write(0x2018, 12345, client_), GvcpStatus::InvalidParameter);  // no such pixel format
  EXPECT_EQ(write(0x0000, 1, client_), GvcpStatus::WriteProtect);
  EXPECT_EQ(write(0x10000, 1, client_), GvcpStatus::InvalidAddress);
  EXPECT_EQ(write(0xfffffffc, 1, client_), GvcpStatus::InvalidAddress);
  EXPECT_EQ(write(0x2009, 1, client_), GvcpStatus::BadAlignment);
}

}  // namespace
}  // namespace flamefield
