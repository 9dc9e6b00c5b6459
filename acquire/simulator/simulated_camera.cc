#include "acquire/simulator/simulated_camera.h"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>

#include "acquire/pixel_code.h"
#include "acquire/simulator/big_endian.h"
#include "acquire/simulator/genicam_xml.h"
#include "acquire/simulator/registers.h"
#include "proto/utc.h"

namespace flamefield {

SimulatedCamera::SimulatedCamera(const SimulatedCameraOptions& options, SceneSource scene, int stream_socket)
    : options_(options),
      scene_(std::move(scene)),
      stream_socket_(stream_socket),
      registers_(genicam_xml(options.width_px, options.height_px, options.has_ptp)),
      sensor_(options.sensor, options.width_px, options.height_px, options.seed * 1000 + options.number),
      epoch_ns_(utc_now_ns()),
      clock_offset_ns_(options.clock_offset_ns) {
  reset_registers();
  thread_ = std::thread([this] { run(); });
}

SimulatedCamera::~SimulatedCamera() {
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
  }
  wake_.notify_all();
  thread_.join();
  ::close(stream_socket_);
}

std::optional<std::vector<std::uint8_t>> SimulatedCamera::handle(std::span<const std::uint8_t> packet,
                                                                 const sockaddr_in& from) {
  const std::optional<GvcpCommand> command = decode_gvcp(packet);
  {
    const std::lock_guard lock(mutex_);
    if (!has_power_) controller_.reset();
    if (!has_power_ || is_link_cut_) return std::nullopt;
    ++(command ? counters_.commands : counters_.refused_packets);
  }
  if (!command) return std::nullopt;
  if (registers_.get(reg::kControlPrivilege) == 0) controller_.reset();  // the power was off meanwhile
  expire_control();
  if (controller_ && controller_->address == from.sin_addr.s_addr && controller_->port == from.sin_port) {
    controller_->heard_ns = utc_now_ns();
  }

  GvcpStatus status = GvcpStatus::InvalidParameter;
  std::vector<std::uint8_t> reply;
  switch (command->code) {
    case GvcpCode::Discovery:
      status = GvcpStatus::Success;
      reply.resize(reg::kDiscoverySize);
      registers_.read(0, reply);
      break;
    case GvcpCode::ReadRegisters:
      if (const auto addresses = decode_read_registers(command->payload)) {
        status = GvcpStatus::Success;
        for (std::uint32_t address : *addresses) {
          std::array<std::uint8_t, 4> word{};
          if (address % 4 != 0) {
            status = GvcpStatus::BadAlignment;
          } else if (!registers_.read(address, word)) {
            status = GvcpStatus::InvalidAddress;
          }
          if (status != GvcpStatus::Success) break;
          reply.insert(reply.end(), word.begin(), word.end());
        }
      }
      break;
    case GvcpCode::WriteRegisters:
      if (const auto writes = decode_write_registers(command->payload)) {
        std::uint32_t done = 0;
        for (const RegisterWrite& write : *writes) {
          status = write_register(write, from);
          if (status != GvcpStatus::Success) break;
          ++done;
        }
        append_u32(reply, done);
      }
      break;
    case GvcpCode::ReadMemory:
      if (const auto range = decode_read_memory(command->payload)) {
        std::vector<std::uint8_t> bytes(range->size);
        status = registers_.read(range->address, bytes) ? GvcpStatus::Success : GvcpStatus::InvalidAddress;
        append_u32(reply, range->address);
        if (status == GvcpStatus::Success) reply.insert(reply.end(), bytes.begin(), bytes.end());
      }
      break;
    case GvcpCode::WriteMemory:
      status = write_memory(command->payload, from);
      append_u32(reply, static_cast<std::uint32_t>(command->payload.size()));
      break;
    case GvcpCode::Action:
      if (const auto action = decode_action(*command)) {
        status = GvcpStatus::Success;
        act(*action);
      }
      break;
    case GvcpCode::PacketResend:
      if (const auto request = decode_resend(command->payload)) resend(*request);
      return std::nullopt;  // the packets are the answer
    default:
      status = GvcpStatus::NotImplemented;
  }
  if (!command->wants_acknowledge) return std::nullopt;
  return encode_acknowledge(*command, status, reply);
}

bool SimulatedCamera::may_write(const sockaddr_in& from) const {
  return !controller_ || (controller_->address == from.sin_addr.s_addr && controller_->port == from.sin_port);
}

void SimulatedCamera::act(const ActionCommand& action) {
  if (action.device_key != registers_.get(reg::kActionDeviceKey) ||
      action.group_key != registers_.get(reg::kActionGroupKey) ||
      (action.group_mask & registers_.get(reg::kActionGroupMask)) == 0) {
    return;
  }
  // One that comes too late is done at once.
  const std::int64_t now_ns = utc_now_ns();
  const std::int64_t due_ns = action.ticks ? std::max(time_of(*action.ticks), now_ns) : now_ns;
  count_and_order({.number = 0, .index = 0, .time_ns = due_ns}, reg::kSourceAction1);
}

void SimulatedCamera::latch_clock() {
  const std::uint64_t ticks = ticks_at(utc_now_ns());
  registers_.set(reg::kTimestampHigh, static_cast<std::uint32_t>(ticks >> 32));
  registers_.set(reg::kTimestampLow, static_cast<std::uint32_t>(ticks));
}

void SimulatedCamera::release_control() {
  controller_.reset();
  registers_.set(reg::kControlPrivilege, 0);
  registers_.set(reg::kAcquisition, 0);
  registers_.set(reg::kStreamPort, 0);
  const std::lock_guard lock(mutex_);
  orders_.clear();
}

void SimulatedCamera::expire_control() {
  if (!controller_) return;
  const std::int64_t timeout_ns = std::int64_t{registers_.get(reg::kHeartbeatTimeout)} * 1'000'000;
  if (utc_now_ns() - controller_->heard_ns > timeout_ns) release_control();
}

void SimulatedCamera::set_power(bool on) {
  const std::lock_guard lock(mutex_);
  if (on == has_power_) return;
  has_power_ = on;
  epoch_ns_ = utc_now_ns();
  clock_offset_ns_ = 0;
  orders_.clear();
  history_.clear();
  trigger_count_ = 0;
  reset_registers();
}

void SimulatedCamera::set_faults(const CameraFaults& faults) {
  const std::lock_guard lock(mutex_);
  faults_ = faults;
}

SimulatedCameraCounters SimulatedCamera::counters() const {
  const std::lock_guard lock(mutex_);
  return counters_;
}

}  // namespace flamefield
