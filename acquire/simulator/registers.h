#pragma once

#include <array>
#include <cstdint>

// Where the simulated camera keeps what. Bootstrap registers: GigE Vision 2.0, section 28. The others are
// ours, and clients learn them from the GenICam file.
namespace flamefield::reg {

inline constexpr std::uint32_t kVersion = 0x0000;
inline constexpr std::uint32_t kDeviceMode = 0x0004;
inline constexpr std::uint32_t kMacHigh = 0x0008;
inline constexpr std::uint32_t kMacLow = 0x000c;
inline constexpr std::uint32_t kIpAddress = 0x0024;
inline constexpr std::uint32_t kSubnetMask = 0x0034;
inline constexpr std::uint32_t kVendorName = 0x0048;        // 32 bytes
inline constexpr std::uint32_t kModelName = 0x0068;         // 32
inline constexpr std::uint32_t kDeviceVersion = 0x0088;     // 32
inline constexpr std::uint32_t kManufacturerInfo = 0x00a8;  // 48
inline constexpr std::uint32_t kSerialNumber = 0x00d8;      // 16
inline constexpr std::uint32_t kUserName = 0x00e8;          // 16
inline constexpr std::uint32_t kDiscoverySize = 0x00f8;
inline constexpr std::uint32_t kXmlUrl = 0x0200;  // 512
inline constexpr std::uint32_t kInterfaceCount = 0x0600;
inline constexpr std::uint32_t kStreamChannelCount = 0x0904;
inline constexpr std::uint32_t kCapability = 0x0934;
inline constexpr std::uint32_t kHeartbeatTimeout = 0x0938;  // ms
inline constexpr std::uint32_t kTickFrequencyHigh = 0x093c;
inline constexpr std::uint32_t kTickFrequencyLow = 0x0940;
inline constexpr std::uint32_t kTimestampControl = 0x0944;  // 2 latches
inline constexpr std::uint32_t kTimestampHigh = 0x0948;
inline constexpr std::uint32_t kTimestampLow = 0x094c;
inline constexpr std::uint32_t kControlPrivilege = 0x0a00;
inline constexpr std::uint32_t kStreamPort = 0x0d00;
inline constexpr std::uint32_t kPacketSize = 0x0d04;   // bit 31 fires a test packet
inline constexpr std::uint32_t kPacketDelay = 0x0d08;  // ticks
inline constexpr std::uint32_t kStreamAddress = 0x0d18;

inline constexpr std::uint32_t kSensorWidth = 0x2000;
inline constexpr std::uint32_t kSensorHeight = 0x2004;
inline constexpr std::uint32_t kWidth = 0x2008;
inline constexpr std::uint32_t kHeight = 0x200c;
inline constexpr std::uint32_t kOffsetX = 0x2010;
inline constexpr std::uint32_t kOffsetY = 0x2014;
inline constexpr std::uint32_t kPixelFormat = 0x2018;
inline constexpr std::uint32_t kPayloadSize = 0x201c;
inline constexpr std::uint32_t kGainRaw = 0x2020;
inline constexpr std::uint32_t kBlackLevelRaw = 0x2024;
inline constexpr std::uint32_t kTestImage = 0x2028;  // 1: a stamped ramp instead of the sensor's picture
inline constexpr std::uint32_t kBinningX = 0x202c;
inline constexpr std::uint32_t kBinningY = 0x2030;
inline constexpr std::uint32_t kAcquisition = 0x2040;  // 1 while the camera may send pictures
inline constexpr std::uint32_t kAcquisitionMode = 0x2044;
inline constexpr std::uint32_t kExposure = 0x2048;           // us
inline constexpr std::uint32_t kFramePeriod = 0x204c;        // us
inline constexpr std::uint32_t kTransmissionDelay = 0x2050;  // ticks
inline constexpr std::uint32_t kTriggerDelay = 0x2054;       // us
inline constexpr std::uint32_t kTriggerSoftware = 0x2060;
inline constexpr std::uint32_t kTriggerSelectorStride = 0x20;  // FrameStart at +0, AcquisitionStart at +0x20
inline constexpr std::uint32_t kTriggerMode = 0x2080;
inline constexpr std::uint32_t kTriggerSource = 0x2084;
inline constexpr std::uint32_t kTriggerActivation = 0x2088;
inline constexpr std::uint32_t kCounterReset = 0x20c0;
inline constexpr std::uint32_t kCounterValue = 0x20c4;  // triggers since the reset
inline constexpr std::uint32_t kChunkMode = 0x2100;
inline constexpr std::uint32_t kChunkSelectorStride = 0x4;
inline constexpr std::uint32_t kChunkEnable = 0x2104;  // one register for each of kChunkIds
inline constexpr std::uint32_t kActionDeviceKey = 0x2140;
inline constexpr std::uint32_t kActionGroupKey = 0x2144;
inline constexpr std::uint32_t kActionGroupMask = 0x2148;

inline constexpr std::uint32_t kPtpEnable = 0x2160;
inline constexpr std::uint32_t kPtpStatus = 0x2164;  // kPtpSlave while the clock keeps the network's time
inline constexpr std::uint32_t kPtpDisabled = 3, kPtpSlave = 9;  // IEEE 1588-2008, table 8

inline constexpr std::uint32_t kChunkFramecounterId = 0xa3a0;
inline constexpr std::uint32_t kChunkTriggerinputcounterId = 0xa3a1;
inline constexpr std::uint32_t kChunkTimestampId = 0xa3a2;
inline constexpr std::uint32_t kChunkExposureTimeId = 0xa3a3;
inline constexpr std::array kChunkIds = {kChunkFramecounterId, kChunkTriggerinputcounterId, kChunkTimestampId,
                                         kChunkExposureTimeId};
inline constexpr std::uint32_t kChunkImageId = 0x0001;

inline constexpr std::uint32_t kXml = 0x10000;  // the GenICam file starts here, read-only

inline constexpr std::uint32_t kTickFrequency_hz = 125'000'000;  // as in the real camera
inline constexpr std::uint32_t kSourceLine1 = 1;
inline constexpr std::uint32_t kSourceSoftware = 0;
inline constexpr std::uint32_t kSourceAction1 = 3;
inline constexpr std::uint32_t kMaxBinning = 4;

}  // namespace flamefield::reg
