// The registers of the simulated camera: what they hold after power-up, who may write them, and what happens
// then.
#include <arpa/inet.h>

#include <algorithm>
#include <array>
#include <cstdio>

#include "acquire/pixel_code.h"
#include "acquire/simulator/big_endian.h"
#include "acquire/simulator/registers.h"
#include "acquire/simulator/simulated_camera.h"
#include "proto/utc.h"

namespace flamefield {

namespace {

constexpr std::uint32_t kCapabilities = 1u << 1 | 1u << 2 | 1u << 6;  // WRITEMEM, packet resend, ACTION
constexpr std::uint32_t kControlBits = 3;                             // exclusive, control
constexpr std::uint32_t kFireTestPacket = 1u << 31;
constexpr std::uint32_t kPacketSizeMask = 0xffff;
constexpr std::uint32_t kMinPacketSize = 220, kMaxPacketSize = 16404;

struct WritableRange {
  std::uint32_t first, last, min, max;
};

// What a client may write, and between which values.
std::vector<WritableRange> writable_ranges(int width_px, int height_px) {
  const auto width = static_cast<std::uint32_t>(width_px), height = static_cast<std::uint32_t>(height_px);
  constexpr std::uint32_t kAny = 0xffffffff;
  const std::uint32_t other_trigger = reg::kTriggerSelectorStride;
  return {
      {reg::kHeartbeatTimeout, reg::kHeartbeatTimeout, 500, kAny},
      {reg::kTimestampControl, reg::kTimestampControl, 0, 3},
      {reg::kControlPrivilege, reg::kControlPrivilege, 0, kControlBits},
      {reg::kStreamPort, reg::kStreamPort, 0, kAny},
      {reg::kPacketSize, reg::kPacketSize, 0, kAny},
      {reg::kPacketDelay, reg::kPacketDelay, 0, kAny},
      {reg::kStreamAddress, reg::kStreamAddress, 0, kAny},
      {reg::kWidth, reg::kWidth, 1, width},
      {reg::kHeight, reg::kHeight, 1, height},
      {reg::kOffsetX, reg::kOffsetX, 0, width - 1},
      {reg::kOffsetY, reg::kOffsetY, 0, height - 1},
      {reg::kPixelFormat, reg::kPixelFormat, 0, kAny},
      {reg::kGainRaw, reg::kGainRaw, 0, 500},
      {reg::kBlackLevelRaw, reg::kBlackLevelRaw, 0, 255},
      {reg::kTestImage, reg::kTestImage, 0, 1},
      {reg::kBinningX, reg::kBinningY, 1, reg::kMaxBinning},
      {reg::kAcquisition, reg::kAcquisition, 0, 1},
      {reg::kAcquisitionMode, reg::kAcquisitionMode, 0, 2},
      {reg::kExposure, reg::kExposure, 4, 1'000'000},
      {reg::kFramePeriod, reg::kFramePeriod, 10'000, 10'000'000},
      {reg::kTransmissionDelay, reg::kTransmissionDelay, 0, 50'000'000},
      {reg::kTriggerDelay, reg::kTriggerDelay, 0, 1'000'000},
      {reg::kTriggerSoftware, reg::kTriggerSoftware, 0, 1},
      {reg::kTriggerMode, reg::kTriggerActivation, 0, reg::kSourceAction1},
      {reg::kTriggerMode + other_trigger, reg::kTriggerActivation + other_trigger, 0, reg::kSourceAction1},
      {reg::kCounterReset, reg::kCounterReset, 0, 1},
      {reg::kActionDeviceKey, reg::kActionGroupMask, 0, kAny},
      {reg::kPtpEnable, reg::kPtpEnable, 0, 1},
      {reg::kChunkMode, reg::kChunkEnable + (reg::kChunkIds.size() - 1) * reg::kChunkSelectorStride, 0, 1}};
}

}  // namespace

void SimulatedCamera::reset_registers() {
  const auto width = static_cast<std::uint32_t>(options_.width_px);
  const auto height = static_cast<std::uint32_t>(options_.height_px);
  in_addr reported = options_.address;
  if (!options_.reported_address.empty()) inet_pton(AF_INET, options_.reported_address.c_str(), &reported);
  std::array<char, 64> url{};
  std::snprintf(url.data(), url.size(), "Local:camera.xml;%x;%x", reg::kXml,
                static_cast<unsigned>(registers_.xml_size()));
  const std::pair<std::uint32_t, std::uint32_t> defaults[] = {
      {reg::kVersion, 0x00010002},
      {reg::kDeviceMode, 0x80000001},  // big endian, UTF-8
      {reg::kMacHigh, 0x0000'0200},
      {reg::kMacLow, ntohl(options_.address.s_addr)},
      {reg::kIpAddress, ntohl(reported.s_addr)},
      {reg::kSubnetMask, 0xff000000},
      {reg::kInterfaceCount, 1},
      {reg::kStreamChannelCount, 1},
      {reg::kCapability, kCapabilities},
      {reg::kHeartbeatTimeout, 3000},
      {reg::kTickFrequencyHigh, 0},
      {reg::kTickFrequencyLow, reg::kTickFrequency_hz},
      {reg::kControlPrivilege, 0},
      {reg::kStreamPort, 0},
      {reg::kPacketSize, 1500},
      {reg::kPacketDelay, 0},
      {reg::kSensorWidth, width},
      {reg::kSensorHeight, height},
      {reg::kWidth, width},
      {reg::kHeight, height},
      {reg::kOffsetX, 0},
      {reg::kOffsetY, 0},
      {reg::kPixelFormat, kPixelCodes[0].code},
      {reg::kPayloadSize, width * height},
      {reg::kGainRaw, 0},
      {reg::kBlackLevelRaw, 0},
      {reg::kTestImage, 0},
      {reg::kBinningX, 1},
      {reg::kBinningY, 1},
      {reg::kTriggerDelay, 0},
      {reg::kActionDeviceKey, 0},
      {reg::kActionGroupKey, 0},
      {reg::kActionGroupMask, 0},
      {reg::kPtpEnable, 0},
      {reg::kPtpStatus, reg::kPtpDisabled},
      {reg::kAcquisition, 0},
      {reg::kAcquisitionMode, 2},
      {reg::kExposure, static_cast<std::uint32_t>(kSceneExposure_us)},
      {reg::kFramePeriod, 200'000},
      {reg::kTransmissionDelay, 0},
      {reg::kTriggerMode, 0},
      {reg::kTriggerSource, reg::kSourceLine1},
      {reg::kTriggerActivation, 0},
      {reg::kTriggerMode + reg::kTriggerSelectorStride, 0},
      {reg::kChunkMode, 0}};
  for (std::uint32_t i = 0; i < reg::kChunkIds.size(); ++i) {
    registers_.set(reg::kChunkEnable + i * reg::kChunkSelectorStride, 0);
  }
  for (const auto& [address, value] : defaults) registers_.set(address, value);
  registers_.set_text(reg::kVendorName, 32, "Basler");
  registers_.set_text(reg::kModelName, 32, "acA645-100gm");
  registers_.set_text(reg::kDeviceVersion, 32, "simulated");
  registers_.set_text(reg::kManufacturerInfo, 48, "simulated by flamefield");
  registers_.set_text(reg::kSerialNumber, 16, options_.serial);
  registers_.set_text(reg::kUserName, 16, options_.user_name);
  registers_.set_text(reg::kXmlUrl, 512, url.data());
}

GvcpStatus SimulatedCamera::write_register(const RegisterWrite& write, const sockaddr_in& from) {
  if (!may_write(from)) return GvcpStatus::AccessDenied;
  if (write.address % 4 != 0) return GvcpStatus::BadAlignment;
  if (write.address >= reg::kXml) return GvcpStatus::InvalidAddress;
  const auto ranges = writable_ranges(options_.width_px, options_.height_px);
  const auto range = std::find_if(ranges.begin(), ranges.end(), [&](const WritableRange& candidate) {
    return write.address >= candidate.first && write.address <= candidate.last;
  });
  if (range == ranges.end()) return GvcpStatus::WriteProtect;
  if (write.value < range->min || write.value > range->max) return GvcpStatus::InvalidParameter;
  const std::uint32_t packet_size = write.value & kPacketSizeMask;
  if (write.address == reg::kPacketSize && (packet_size < kMinPacketSize || packet_size > kMaxPacketSize)) {
    return GvcpStatus::InvalidParameter;
  }
  if (write.address == reg::kPixelFormat && !pixel_format_from_code(write.value)) {
    return GvcpStatus::InvalidParameter;
  }
  if (write.address == reg::kControlPrivilege) {
    if ((write.value & kControlBits) == 0) {
      release_control();
    } else {
      controller_ = Controller{from.sin_addr.s_addr, from.sin_port, utc_now_ns()};
    }
  }
  registers_.set(write.address, write.value);
  after_write(write);
  return GvcpStatus::Success;
}

// The camera's name is text; anything else is registers, word by word.
GvcpStatus SimulatedCamera::write_memory(std::span<const std::uint8_t> payload, const sockaddr_in& from) {
  if (!may_write(from)) return GvcpStatus::AccessDenied;
  if (payload.size() < 8 || payload.size() > kMaxMemoryBlock || payload.size() % 4 != 0) {
    return GvcpStatus::InvalidParameter;
  }
  const std::uint32_t address = load_u32(payload.data());
  const auto bytes = payload.subspan(4);
  if (address >= reg::kUserName && address + std::uint64_t{bytes.size()} <= reg::kUserName + 16u) {
    return registers_.write(address, bytes) ? GvcpStatus::Success : GvcpStatus::InvalidAddress;
  }
  for (std::uint32_t at = 0; at < bytes.size(); at += 4) {
    const GvcpStatus status = write_register({address + at, load_u32(bytes.data() + at)}, from);
    if (status != GvcpStatus::Success) return status;
  }
  return GvcpStatus::Success;
}

// What the hardware does when a register changes.
void SimulatedCamera::after_write(const RegisterWrite& write) {
  switch (write.address) {
    case reg::kPacketSize:
      registers_.set(reg::kPacketSize, write.value & ~kFireTestPacket);
      if ((write.value & kFireTestPacket) != 0) send_test_packet(write.value & kPacketSizeMask);
      break;
    case reg::kTimestampControl:
      if ((write.value & 2) != 0) latch_clock();
      registers_.set(reg::kTimestampControl, 0);
      break;
    case reg::kTriggerSoftware:
      registers_.set(reg::kTriggerSoftware, 0);
      if (write.value == 1)
        count_and_order({.number = 0, .index = 0, .time_ns = utc_now_ns()}, reg::kSourceSoftware);
      break;
    case reg::kCounterReset: {
      const std::lock_guard lock(mutex_);
      trigger_count_ = 0;
      registers_.set(reg::kCounterReset, 0);
      registers_.set(reg::kCounterValue, 0);
      break;
    }
    case reg::kAcquisition: {
      const std::lock_guard lock(mutex_);
      orders_.clear();
      if (write.value == 1) last_frame_id_ = static_cast<std::uint16_t>(options_.first_frame_id - 1);
      break;
    }
    case reg::kPtpEnable:
      registers_.set(reg::kPtpStatus, keeps_network_time() ? reg::kPtpSlave : reg::kPtpDisabled);
      break;
    case reg::kBinningX:
    case reg::kBinningY:
      fit_region();
      break;
    default:
      update_payload_size();
  }
  { const std::lock_guard lock(mutex_); }  // the picture thread is either asleep or has yet to look
  wake_.notify_all();
}

// Binned pixels are larger, so fewer fit on the sensor.
void SimulatedCamera::fit_region() {
  const auto shrink = [this](std::uint32_t size, std::uint32_t offset, std::uint32_t binning, int sensor_px) {
    const std::uint32_t most = static_cast<std::uint32_t>(sensor_px) / registers_.get(binning);
    registers_.set(size, std::min(registers_.get(size), most));
    registers_.set(offset, std::min(registers_.get(offset), most - registers_.get(size)));
  };
  shrink(reg::kWidth, reg::kOffsetX, reg::kBinningX, options_.width_px);
  shrink(reg::kHeight, reg::kOffsetY, reg::kBinningY, options_.height_px);
  update_payload_size();
}

void SimulatedCamera::update_payload_size() {
  const auto format = pixel_format_from_code(registers_.get(reg::kPixelFormat)).value_or(PixelFormat::Mono8);
  std::size_t payload = bytes_of_image(format, static_cast<int>(registers_.get(reg::kWidth)),
                                       static_cast<int>(registers_.get(reg::kHeight)));
  if (registers_.get(reg::kChunkMode) == 1) {
    payload += 8;  // id and length of the image itself
    for (std::uint32_t i = 0; i < reg::kChunkIds.size(); ++i) {
      const bool is_on = registers_.get(reg::kChunkEnable + i * reg::kChunkSelectorStride) == 1;
      if (is_on) payload += reg::kChunkIds[i] == reg::kChunkTimestampId ? 16 : 12;
    }
  }
  registers_.set(reg::kPayloadSize, static_cast<std::uint32_t>(payload));
}

}  // namespace flamefield
